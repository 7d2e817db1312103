"""Which unit an id is: twins are distinguished by number or place, and what moves something is never guessed."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sysfs_tree import Tree

from octoform import runtime
from octoform.base import serials
from octoform.runtime import binding
from octoform.runtime.sysfs import place, socket

BOARD, TWIN = "usb-1f00-00c1", "usb-1f00-00c1-2"
Instances = Callable[[dict[str, Any]], Path]


def plug(tree: Tree, port: str, serial: str = "", root: str = "pci0/usb1") -> None:
    """A board of two interfaces on a port."""
    tree.usb(f"{root}/{port}", "1f00", "00c1", serial)
    for number in range(2):
        tree.bus(f"{root}/{port}/{port}:1.{number}", "usb")


def at(port: str, serial: str = "", strength: str = "positional", root: str = "pci0/usb1") -> dict[str, str]:
    known = {"sysfs": f"/sys/devices/{root}/{port}", "port": port, "strength": strength}
    return known | ({"serial": serial} if serial else {})


def read(device: str) -> str:
    """The port from which a reader is answered."""
    return runtime.device(device).folder.name


def move(device: str) -> str:
    """The port at which something would be moved."""
    return runtime.device(device, actuate=True).folder.name


def refused(device: str, reason: str) -> None:
    with pytest.raises(runtime.AmbiguousDevice, match=reason):
        runtime.device(device, actuate=True)


def test_twins_that_both_moved_are_refused_for_an_actuator_and_stay_two_for_readers(
    tree: Tree, instances: Instances
) -> None:
    instances({BOARD: at("1-2"), TWIN: at("1-3")})
    plug(tree, "1-4")
    plug(tree, "1-5")
    refused(BOARD, "2 equal devices .1-4, 1-5.*plug it back into 1-2, or run `octoform apply -replace probe`")
    refused(TWIN, "2 equal devices")
    assert (read(BOARD), read(TWIN)) == ("1-4", "1-5")


def test_one_of_two_missing_twins_in_a_new_port_may_be_either(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2"), TWIN: at("1-3")})
    plug(tree, "1-5")
    refused(BOARD, f"1-5 may be {BOARD} or {TWIN}")
    refused(TWIN, f"1-5 may be {TWIN} or {BOARD}")
    assert read(BOARD) == "1-5"
    with pytest.raises(runtime.DeviceAbsent):
        read(TWIN)


def test_one_without_a_number_is_moved_in_a_new_port_where_it_is_the_only_one(tree: Tree, instances: Instances) -> None:
    """Each of its interfaces has the ids of the device too, and is no second one."""
    instances({BOARD: at("1-2")})
    plug(tree, "1-5")
    assert move(BOARD) == read(BOARD) == "1-5"


def test_one_moved_while_its_twin_stayed_is_known_by_what_is_left(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2"), TWIN: at("1-3")})
    plug(tree, "1-3")
    plug(tree, "1-5")
    assert (move(BOARD), move(TWIN)) == ("1-5", "1-3")
    assert runtime.device(BOARD, actuate=True).strength == "weak"


def test_a_port_is_the_identity_of_a_twin_without_a_number(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2"), TWIN: at("1-3")})
    plug(tree, "1-2")
    assert move(BOARD) == "1-2"
    with pytest.raises(runtime.DeviceAbsent, match="not attached"):
        move(TWIN)


def test_a_new_twin_elsewhere_does_not_unsettle_one_in_its_place(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2")})
    plug(tree, "1-2")
    plug(tree, "1-7")
    assert move(BOARD) == "1-2"


def test_swapped_twins_with_numbers_are_followed_and_without_are_their_ports(tree: Tree, instances: Instances) -> None:
    plug(tree, "1-2", "B7")
    plug(tree, "1-3", "A5")
    instances({BOARD: at("1-2", "A5", "strong"), TWIN: at("1-3", "B7", "strong")})
    assert (move(BOARD), move(TWIN), read(BOARD), read(TWIN)) == ("1-3", "1-2", "1-3", "1-2")


def test_another_product_in_the_port_is_not_the_device(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2")})
    tree.usb("pci0/usb1/1-2", "1f00", "00ff")
    for call in (read, move):
        with pytest.raises(runtime.DeviceAbsent):
            call(BOARD)


@pytest.mark.parametrize("strength", ["strong", "positional"])
def test_another_specimen_in_the_port_shows_another_number(tree: Tree, instances: Instances, strength: str) -> None:
    instances({BOARD: at("1-2", "A5", strength)})
    plug(tree, "1-2", "C9")
    for call in (read, move):
        with pytest.raises(runtime.DeviceAbsent, match="another serial number"):
            call(BOARD)


def test_a_number_that_is_no_longer_shown_stops_an_actuator_only(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "A5", "strong")})
    plug(tree, "1-2")
    refused(BOARD, "does not show the serial number")
    assert read(BOARD) == "1-2"
    assert runtime.device(BOARD).strength == "positional"


def test_one_with_a_number_elsewhere_is_not_moved_for_one_that_had_none(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2")})
    plug(tree, "1-4", "C9")
    refused(BOARD, f"1-4 shows a serial number, and {BOARD} had none")
    assert read(BOARD) == "1-4"


def test_a_number_that_two_show_is_none(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "A5", "strong")})
    plug(tree, "1-4", "A5")
    plug(tree, "1-5", "A5")
    refused(BOARD, "2 equal devices")
    plug(tree, "1-2", "A5")
    assert move(BOARD) == "1-2"
    assert runtime.device(BOARD, actuate=True).strength == "positional"


@pytest.mark.parametrize("serial", ["", " ", "000000000000", "0123456789ABCDEF", "123456", "n/a", "Serial", "FFFF"])
def test_what_makers_put_in_place_of_a_number_never_equals_another(
    tree: Tree, instances: Instances, serial: str
) -> None:
    assert not serials.is_distinctive(serial)
    instances({BOARD: at("1-2", serial, "strong"), TWIN: at("1-3", serial, "strong")})
    plug(tree, "1-4", serial)
    plug(tree, "1-5", serial)
    refused(BOARD, "2 equal devices")


def test_a_number_is_compared_as_tools_spell_it() -> None:
    assert serials.same("ab 12-7", "AB_12_7")
    assert not serials.same("AB127", "AB128")
    assert not serials.same("", "")


@pytest.mark.parametrize("default", ["0001", "123456", "0123456789", "SN000001", "200901010001"])
def test_an_actuator_does_not_follow_a_default_number_to_a_twin(tree: Tree, instances: Instances, default: str) -> None:
    instances({BOARD: at("1-2", default, "strong")})
    plug(tree, "1-4", default)
    plug(tree, "1-5", "D744C4C5")
    refused(BOARD, "2 equal devices .1-4, 1-5")
    plug(tree, "1-2", default)
    assert move(BOARD) == "1-2"


def test_a_default_number_serves_where_it_is_the_only_one_of_its_kind(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "0001", "strong")})
    plug(tree, "1-4", "0001")
    assert move(BOARD) == "1-4"
    assert runtime.device(BOARD, actuate=True).strength == "weak"


def test_a_unit_with_another_default_number_is_another_unit(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "0001", "positional"), TWIN: at("1-3", "0002", "positional")})
    plug(tree, "1-2", "0002")
    plug(tree, "1-3", "0001")
    refused(BOARD, "2 equal devices")
    refused(TWIN, "2 equal devices")


def test_a_hub_in_another_port_keeps_the_order_for_readers_and_stops_actuators(
    tree: Tree, instances: Instances
) -> None:
    instances({BOARD: at("1-2.1", root="pci0/usb1/1-2"), TWIN: at("1-2.4", root="pci0/usb1/1-2")})
    tree.usb("pci0/usb1/1-3", "1f00", "0b00")
    plug(tree, "1-3.1", root="pci0/usb1/1-3")
    plug(tree, "1-3.4", root="pci0/usb1/1-3")
    assert (read(BOARD), read(TWIN)) == ("1-3.1", "1-3.4")
    refused(BOARD, "2 equal devices")


def test_buses_that_are_counted_anew_do_not_move_a_device(tree: Tree, instances: Instances) -> None:
    # Two controllers whose buses changed their numbers at a start: port 1-2 is now the other one's.
    instances({BOARD: at("1-2", root="ctl0/usb1"), TWIN: at("3-2", root="ctl1/usb3")})
    plug(tree, "3-2", root="ctl0/usb3")
    plug(tree, "1-2", root="ctl1/usb1")
    assert (move(BOARD), move(TWIN)) == ("3-2", "1-2")
    assert runtime.device(BOARD, actuate=True).strength == "positional"


def test_a_port_alone_is_enough_where_no_path_was_recorded(tree: Tree, instances: Instances) -> None:
    instances({BOARD: {"port": "1-3"}, TWIN: {"port": "1-2"}})
    plug(tree, "1-2")
    plug(tree, "1-3")
    assert (move(BOARD), move(TWIN)) == ("1-3", "1-2")


def keyboard(tree: Tree, number: int, unique: str = "", product: str = "0BBB") -> None:
    name = f"0003:1F00:{product}.{number:04X}"
    known: dict[str, Any] = {"HID_ID": f"0003:00001F00:0000{product}"} | ({"HID_UNIQ": unique} if unique else {})
    tree.bus(f"pci0/usb1/1-1/{name}", "hid", **known)


def behind(number: int, unique: str = "") -> dict[str, str]:
    name = f"0003:1F00:0BBB.{number:04X}"
    known = {"sysfs": f"/sys/devices/pci0/usb1/1-1/{name}", "port": name, "strength": "weak"}
    return known | ({"serial": unique, "strength": "strong"} if unique else {})


def test_numbers_of_hid_devices_are_no_place(tree: Tree, instances: Instances) -> None:
    instances({"hid-1f00-0bbb": behind(2), "hid-1f00-0bbb-2": behind(3)})
    keyboard(tree, 2)
    keyboard(tree, 3)
    refused("hid-1f00-0bbb", "may be")
    assert read("hid-1f00-0bbb-2").endswith(".0003")


def test_one_of_two_behind_a_receiver_may_be_either(tree: Tree, instances: Instances) -> None:
    instances({"hid-1f00-0bbb": behind(2), "hid-1f00-0bbb-2": behind(3)})
    keyboard(tree, 2)
    refused("hid-1f00-0bbb", "may be hid-1f00-0bbb or hid-1f00-0bbb-2")


def test_two_behind_one_receiver_swap_numbers_and_are_told_apart_by_their_own(tree: Tree, instances: Instances) -> None:
    instances({"hid-1f00-0bbb": behind(2, "aa-01"), "hid-1f00-0bbb-2": behind(3, "aa-02")})
    keyboard(tree, 2, "aa-02")
    keyboard(tree, 3, "aa-01")
    assert move("hid-1f00-0bbb").endswith(".0003")
    assert read("hid-1f00-0bbb").endswith(".0003")
    assert read("hid-1f00-0bbb-2").endswith(".0002")


def test_a_number_that_a_driver_has_not_read_yet_is_not_another(tree: Tree, instances: Instances) -> None:
    instances({"hid-1f00-0bbb": behind(2, "aa-01")})
    keyboard(tree, 9)
    assert move("hid-1f00-0bbb").endswith(".0009")


def test_the_lines_of_a_composite_device_keep_their_order_under_new_names(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2")})
    plug(tree, "1-2")
    for interface, name in ((0, "ttyUSB7"), (1, "ttyUSB2")):
        tree.member(f"pci0/usb1/1-2/1-2:1.{interface}/{name}/tty/{name}", "tty", DEVNAME=name)
    assert [Path(node).name for node in runtime.device(BOARD).nodes("tty")] == ["ttyUSB7", "ttyUSB2"]


def test_disks_that_swap_names_are_found_by_their_kind(tree: Tree, instances: Instances) -> None:
    disks = {"scsi-acme-one": "target0:0:0/0:0:0:0", "scsi-acme-two": "target0:0:1/0:0:1:0"}
    instances(
        {
            name: {"sysfs": f"/sys/devices/host0/{path}", "port": path[-7:], "strength": "weak"}
            for name, path in disks.items()
        }
    )
    for path, model, node in (("0:0/0:0:0:0", "two", "sda"), ("0:1/0:0:1:0", "one", "sdb")):
        tree.bus(f"host0/target0:{path}", "scsi", {"vendor": "ACME", "model": model})
        tree.member(f"host0/target0:{path}/block/{node}", "block", DEVNAME=node)
    assert runtime.device("scsi-acme-one").path("block").name == "sdb"
    assert runtime.device("scsi-acme-two").path("block").name == "sda"


def test_same_number_on_two_products_is_no_doubt(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "A5", "strong")})
    tree.usb("pci0/usb1/1-3", "1f00", "00ff", "A5")
    plug(tree, "1-9", "A5")
    assert move(BOARD) == "1-9"


def test_nothing_is_moved_while_the_instances_cannot_be_read(tree: Tree, instances: Instances) -> None:
    plug(tree, "1-2")
    path = instances({})
    path.write_text("{")
    refused(BOARD, "cannot be read on this machine.*octoform apply")
    path.unlink()
    refused(BOARD, "cannot be read")
    assert read(BOARD) == "1-2"


def test_an_id_that_an_older_file_does_not_know_leaves_others_theirs(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-3")})
    plug(tree, "1-2")
    plug(tree, "1-3")
    assert (read(TWIN), move(TWIN), move(BOARD)) == ("1-2", "1-2", "1-3")


def test_a_place_has_none_of_the_numbers_that_change() -> None:
    assert place("/sys/devices/usb1/1-1/0003:1F00:0BBB.0004") == "/sys/devices/usb1/1-1/0003:1F00:0BBB"
    assert place("/sys/devices/virtual/hwmon/hwmon3") == place("/sys/devices/virtual/hwmon/hwmon12")
    assert place("/a/usb1/1-2") != place("/a/usb2/2-2")
    assert socket("/a/usb1/1-2.3/1-2.3:1.0") == socket("/a/usb4/4-2.3/4-2.3:1.0")
    assert socket("/a/usb1/1-2") != socket("/a/usb1/1-3")
    assert socket("/a/i2c-1/1-0048") != socket("/a/i2c-1/1-0049")


def test_channels_that_are_counted_otherwise_are_not_swapped(tree: Tree, instances: Instances) -> None:
    # Two converters behind one multiplexer, whose channels were 5 and 6: what is 6 now is the one that was 5.
    mux = "soc/i2c-1/1-0070"
    first, second = "i2c-acme-dac", "i2c-acme-dac-2"

    def converter(channel: int) -> str:
        folder = f"{mux}/i2c-{channel}/{channel}-0048"
        tree.bus(folder, "i2c", {"name": "acme-dac"})
        return f"/sys/devices/{folder}"

    known = {
        name: {"sysfs": f"/sys/devices/{mux}/i2c-{channel}/{channel}-0048", "port": f"{channel}-0048"}
        for name, channel in ((first, 5), (second, 6))
    }
    instances(known)
    converter(6)
    refused(second, "may be")
    converter(7)
    refused(first, "2 equal devices")
    refused(second, "2 equal devices")
    instances({first: known[second], second: {**known[second], "sysfs": known[second]["sysfs"].replace("6", "7")}})
    assert (move(first), move(second)) == ("6-0048", "7-0048")


def test_what_acts_is_looked_for_again_once_its_lock_is_held(tree: Tree, instances: Instances) -> None:
    instances({BOARD: at("1-2", "A5", "strong"), TWIN: at("1-3", "B7", "strong")})
    plug(tree, "1-2", "A5")
    plug(tree, "1-3", "B7")
    acting, reading = runtime.device(BOARD, actuate=True), runtime.device(BOARD)
    with acting.bus() as unit:
        assert unit.folder.name == "1-2"
    # They change places while the call waits for its lock.
    for port, serial in (("1-2", "B7"), ("1-3", "A5")):
        (tree.root / f"sys/devices/pci0/usb1/{port}/serial").write_text(serial)
    for lock in (acting.bus, lambda: runtime.bus(acting)):
        with pytest.raises(runtime.DeviceAbsent, match="plugged in elsewhere while the call waited"), lock():
            pytest.fail("the twin would be moved")
    # The lock was given back, and a reader may go on.
    with reading.bus(timeout=0.02):
        assert move(BOARD) == "1-3"


def card(tree: Tree, serial: str | None) -> None:
    """A memory card; every kernel shows its number, and a recording may lack the attribute."""
    folder = tree.root / "sys/devices/platform/mmc0/mmc0:e624"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "uevent").write_text("MMC_TYPE=SD\nMMC_NAME=SU16G\n")
    (folder / "type").write_text("SD")
    (folder / "name").write_text("SU16G")
    bus = tree.root / "sys/bus/mmc"
    (bus / "devices").mkdir(parents=True, exist_ok=True)
    links = ((folder / "subsystem", bus), (bus / "devices" / folder.name, folder))
    for link, target in links:
        if not link.is_symlink():
            link.symlink_to(target)
    (folder / "serial").unlink(missing_ok=True)
    if serial is not None:
        (folder / "serial").write_text(serial)


def test_a_card_without_the_attribute_is_not_in_doubt_and_one_with_another_number_is_another(
    tree: Tree, instances: Instances
) -> None:
    place = {"sysfs": "/sys/devices/platform/mmc0/mmc0:e624", "port": "mmc0:e624", "strength": "strong"}
    instances({"mmc-sd-su16g": {**place, "serial": "0da36cd8"}})
    for shown in (None, "0x0da36cd8"):
        card(tree, shown)
        assert move("mmc-sd-su16g") == "mmc0:e624"
    card(tree, "")
    refused("mmc-sd-su16g", "serial number")
    card(tree, "0x1ff07a11")
    with pytest.raises(runtime.DeviceAbsent):
        runtime.device("mmc-sd-su16g", actuate=True)


def test_the_serial_number_of_each_bus_is_where_its_kernel_driver_shows_it(tree: Tree) -> None:
    disk = tree.bus("pci0/0000:01:00.0", "pci")
    assert binding.serial(disk) is None
    tree.member("pci0/0000:01:00.0/nvme/nvme0", "nvme", {"serial": "S4EVNF0M123456"})
    assert binding.serial(disk) == "S4EVNF0M123456"
    assert binding.serial(tree.bus("mmc0/mmc0:0001", "mmc", {"serial": "0x1a2b3c4d"})) == "1a2b3c4d"
    assert binding.serial(tree.bus("mmc0/mmc0:0002", "mmc")) is None
    assert binding.serial(tree.usb("pci0/usb1/1-7", "1f00", "00c1")) == ""
    assert binding.serial(tree.bus("hid0/0003:1F00:00C2.0001", "hid", {}, HID_UNIQ="77f3")) == "77f3"
