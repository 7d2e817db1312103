"""Hosts that nobody recorded, made by construction: each device with what is true of it.

A host is a tree in the form of sysfs. Each device has a kind (what the kernel's interface of its class offers), strings
that tell its product, tell nothing, mislead or are in another script, and numbers that a registry knows or does not.
Serial numbers are missing, good, or those that makers leave in by default. A seed makes the same host again; another
order plugs the same devices into other places.
"""

import random
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sysfs_tree import Tree

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify.stage import identify
from octoform.builtin.interface.stage import declare
from octoform.builtin.probe.stage import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.checking import check
from octoform.contracts.model import Artifacts
from octoform.contracts.serve_rules import serve_static
from octoform.diagnostics import Severity

BUDGET = 100
SCHEMAS = Path(__file__).parents[2] / "protocol" / "schemas"

MAKERS = ("Heron", "Quantal", "Brightwater", "Osmo Labs", "Nordwind", "Tessera", "Karoo", "Vireo Works")
MODELS = ("X200", "LX-7", "Pico4", "M310", "Delta9", "QV22", "T-880", "Aria3")
DEFAULT_SERIALS = ("0001", "0123456789", "000000", "111111111111")
SCRIPTS = ("ヘロン", "Журавль", "苍鹭之家", "Ölprüfer", "بلشون")
MISLEADING = ("USB Serial", "USB UART Bridge", "Generic USB Device", "USB2.0-Serial", "Android Bootloader")
CONTROLLER = "pci0000:00/0000:00:14.0/usb1"


@dataclass(frozen=True)
class Made:
    """A device as it was made. ``strings`` says what its strings do: tell, nothing, mislead, script.

    ``tools`` are tools of which it has one at least; empty where no interface of its class offers any.
    ``categories`` are those that are right. ``product`` is the model that its strings tell, "" where they tell none.
    """

    kind: str
    place: str
    strings: str
    default_serial: bool
    categories: frozenset[str]
    tools: frozenset[str]
    product: str = ""


@dataclass(frozen=True)
class _Kind:
    """``bus`` is where it hangs; ``noun`` is the word of class in its strings; ``build`` adds the kernel's classes."""

    bus: str
    noun: str
    categories: tuple[str, ...]
    tools: tuple[str, ...]
    build: Callable[[Tree, str, int], None]
    triple: str = "ff0000"
    driver: str = ""
    chip: bool = False
    """What shows is the chip that wires it, so that without strings nothing tells the product."""


def _member(kind: str, name: str, attributes: dict[str, str], node: bool = False) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        told = {"DEVNAME": f"{name}{number}"} if node else {}
        tree.member(f"{path}/{kind}/{name}{number}", kind, attributes, **told)

    return build


def _nothing(_tree: Tree, _path: str, _number: int) -> None:
    """A device to which no driver is bound."""


def _disk(tree: Tree, path: str, number: int) -> None:
    scsi = f"{path}/host{number}/target{number}:0:0/{number}:0:0:0"
    tree.bus(scsi, "scsi", {"vendor": "Bench", "model": "Disk"}, DRIVER="sd")
    name = f"sd{chr(97 + number % 26)}{chr(97 + number // 26 % 26)}"
    tree.member(f"{scsi}/block/{name}", "block", {"size": "2048", "removable": "1", "ro": "0"}, DEVNAME=name)


def _panel(tree: Tree, path: str, _number: int) -> None:
    # Named after its place in the board's description, as the kernel does where firmware tells one.
    name = f"panel-{path.rpartition('/')[2].partition('.')[0]}"
    given = {"max_brightness": "100", "brightness": "7", "type": "raw"}
    tree.member(f"{path}/backlight/{name}", "backlight", given)


def _card(tree: Tree, path: str, number: int) -> None:
    tree.member(f"{path}/sound/card{number}", "sound", {"id": "USB", "number": str(number)})
    for end in "pc":
        name = f"pcmC{number}D0{end}"
        tree.member(f"{path}/sound/card{number}/{name}", "sound", {"pcm_class": "generic"}, DEVNAME=f"snd/{name}")


def _input(keys: str) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        hid = f"{path}/0003:1F00:0001.{number:04X}"
        tree.bus(hid, "hid", HID_ID="0003:00001F00:00000001", HID_NAME="input", DRIVER="hid-generic")
        bits = {"name": "input", "capabilities/ev": "100003", "capabilities/key": keys}
        tree.member(f"{hid}/input/input{number}", "input", bits)
        tree.member(f"{hid}/input/input{number}/event{number}", "input", {}, DEVNAME=f"input/event{number}")

    return build


def _iio(channels: dict[str, str]) -> Callable[[Tree, str, int], None]:
    def build(tree: Tree, path: str, number: int) -> None:
        tree.bus(f"{path}/iio:device{number}", "iio", {"name": "sensor", **channels}, DEVNAME=f"iio:device{number}")

    return build


KINDS: dict[str, _Kind] = {
    "camera": _Kind(
        *("usb", "Camera", ("sensor",), ("capture_image",)),
        _member("video4linux", "video", {"name": "UVC", "index": "0"}, node=True),
        *("0e0100", "uvcvideo"),
    ),
    "board with a line": _Kind(
        *("usb", "Controller", ("unknown", "sensor", "actuator", "bidirectional"), ()),
        _member("tty", "ttyUSB", {}, node=True),
        *("ff0000", "ch341", True),
    ),
    "disk": _Kind("usb", "Flash Disk", ("infrastructure",), ("read_storage",), _disk, "080650", "usb-storage"),
    "keyboard": _Kind(
        "usb",
        "Keyboard",
        ("sensor",),
        ("describe_input",),
        _input("1000000000007 ff9f207ac14057ff"),
        "030101",
        "usbhid",
    ),
    "sound": _Kind(
        *("usb", "Audio Interface", ("sensor", "actuator", "bidirectional"), ("record_audio", "play_audio")),
        _card,
        *("010100", "snd-usb-audio"),
    ),
    "network": _Kind(
        *("usb", "Ethernet Adapter", ("infrastructure", "bidirectional"), ("read_network_interfaces",)),
        _member("net", "eth", {"address": "02:00:00:00:00:01", "operstate": "up", "type": "1"}),
        *("020d00", "cdc_ncm"),
    ),
    "printer": _Kind(
        *("usb", "Label Printer", ("actuator", "bidirectional"), ()),
        _member("usbmisc", "lp", {}, node=True),
        *("070102", "usblp"),
    ),
    "thermometer": _Kind(
        *("platform", "", ("sensor",), ("read_temperature",)),
        _member("hwmon", "hwmon", {"name": "bench", "temp1_input": "21500", "temp1_label": "board"}),
        driver="bench-temp",
    ),
    "fan controller": _Kind(
        *("i2c", "", ("sensor", "bidirectional"), ("read_fan_speed",)),
        _member("hwmon", "hwmon", {"name": "fanboard", "fan1_input": "900", "pwm1": "120", "pwm1_enable": "1"}),
        driver="emc2305",
    ),
    "climate sensor": _Kind(
        *("i2c", "", ("sensor",), ("read_humidity", "read_temperature", "read_sensor_channels")),
        _iio({"in_temp_input": "21000", "in_humidityrelative_input": "45000", "in_pressure_input": "100.3"}),
        driver="bme280",
    ),
    "accelerometer": _Kind(
        *("acpi", "", ("sensor",), ("read_acceleration",)),
        _iio({"in_accel_x_raw": "10", "in_accel_y_raw": "-4", "in_accel_z_raw": "981", "in_accel_scale": "0.01"}),
        driver="kxcjk1013",
    ),
    "light sensor": _Kind(
        *("acpi", "", ("sensor",), ("read_illuminance",)),
        _iio({"in_illuminance_input": "120"}),
        driver="acpi-als",
    ),
    "converter": _Kind(
        *("spi", "", ("sensor",), ("read_sensor_channels",)),
        _iio({"in_voltage0_raw": "100", "in_voltage1_raw": "200", "in_voltage_scale": "0.8"}),
        driver="mcp3008",
    ),
    "capacitance": _Kind(
        *("i2c", "", ("sensor",), ("read_sensor_channels",)),
        _iio({"in_capacitance0_raw": "77"}),
        driver="ad7746",
    ),
    "outputs": _Kind(
        *("spi", "", ("actuator", "bidirectional"), ("set_output_channel", "read_output_channels")),
        _iio({"out_voltage0_raw": "100", "out_voltage1_raw": "200", "out_voltage_scale": "0.8"}),
        driver="ad5064",
    ),
    "lamp": _Kind(
        *("platform", "", ("actuator", "bidirectional"), ("set_led", "read_led")),
        _member("leds", "bench:led", {"max_brightness": "255", "brightness": "0"}),
        driver="leds-gpio",
    ),
    "panel": _Kind(
        *("platform", "", ("actuator", "bidirectional"), ("set_brightness",)),
        _panel,
        driver="pwm-backlight",
    ),
    "battery": _Kind(
        *("acpi", "", ("sensor",), ("read_battery",)),
        _member("power_supply", "BAT", {"type": "Battery", "capacity": "80", "status": "Full", "present": "1"}),
        driver="battery",
    ),
    "clock": _Kind(
        *("i2c", "", ("infrastructure",), ("read_clock",)),
        _member("rtc", "rtc", {"name": "rtc-ds1307", "time": "10:00:00", "date": "2026-01-01"}, node=True),
        driver="rtc-ds1307",
    ),
    "solid state disk": _Kind(
        *("pci", "", ("infrastructure",), ("read_storage",)),
        lambda tree, path, number: (
            _member("nvme", "nvme", {"model": "Bench SSD 500"}, node=True)(tree, path, number),
            tree.member(
                f"{path}/nvme/nvme{number}/nvme{number}n1", "block", {"size": "4096"}, DEVNAME=f"nvme{number}n1"
            ),
        )[0],
        *("010802", "nvme"),
    ),
    "bluetooth": _Kind(
        "usb",
        "Bluetooth Adapter",
        ("infrastructure", "bidirectional"),
        (),
        _member("bluetooth", "hci", {"type": "primary"}),
        "e00101",
        "btusb",
    ),
    "reader without a driver": _Kind("usb", "Smart Card Reader", ("infrastructure",), (), _nothing, "0b0000"),
    "capture device without a driver": _Kind("usb", "Video Capture", ("sensor",), (), _nothing, "ff0000"),
    "thermal camera without a driver": _Kind("usb", "Thermal Camera", ("sensor",), (), _nothing, "ff0000"),
    "keys without a driver": _Kind("usb", "Trackball", ("sensor",), (), _nothing, "030102"),
    "sound without a driver": _Kind(
        "usb", "MIDI Interface", ("sensor", "actuator", "bidirectional"), (), _nothing, "010300"
    ),
}


def generate(root: Path, seed: int, count: int, order: int = 0) -> list[Made]:
    """Build a host of ``count`` devices below ``root``; what was made, in the order of ``seed`` whatever ``order``."""
    if root.exists():
        shutil.rmtree(root)
    chance = random.Random(seed)
    wanted = [(chance.choice(sorted(KINDS)), chance.random(), index) for index in range(count)]
    tree = Tree(root)
    (root / "etc").mkdir()
    (root / "etc/os-release").write_text('ID=debian\nVERSION_ID="12"\n')
    tree.bus("pci0000:00/0000:00:14.0", "pci", {"vendor": "0x8086", "device": "0x1e31", "class": "0x0c0330"})
    tree.bus(CONTROLLER, "usb", {"idVendor": "1d6b", "idProduct": "0003", "bDeviceClass": "09"})
    slots = list(range(1, count + 1))
    random.Random(order).shuffle(slots) if order else None
    return [_make(tree, kind, random.Random(hash_of(seed, index)), index, slots[index]) for kind, _, index in wanted]


def hash_of(seed: int, index: int) -> int:
    """One number for each device of each host."""
    return seed * 100_003 + index


def _make(tree: Tree, name: str, chance: random.Random, index: int, slot: int) -> Made:
    kind = KINDS[name]
    strings = chance.choice(("tell", "tell", "nothing", "mislead", "script"))
    maker, model = chance.choice(MAKERS), f"{chance.choice(MODELS)}{chance.choice('abcdef')}{index}"
    serial = chance.choice(("", "", f"SN{chance.randrange(10**8):08d}", *DEFAULT_SERIALS)) if kind.bus == "usb" else ""
    texts = {
        "tell": (maker, f"{model} {kind.noun}"),
        "nothing": ("", ""),
        "mislead": ("", chance.choice(MISLEADING)),
        "script": ("", chance.choice(SCRIPTS)),
    }[strings]
    place = {"usb": _usb, "pci": _pci}.get(kind.bus, _other)(tree, kind, index, slot)
    if kind.bus == "usb":
        given = zip(("serial", "manufacturer", "product"), (serial, *texts), strict=True)
        for attribute, text in given:
            if text:
                (tree.root / "sys/devices" / place / attribute).write_text(f"{text}\n")
    kind.build(tree, place if kind.bus != "usb" else f"{place}/{place.rpartition('/')[2]}:1.0", slot)
    told = kind.bus == "usb" and strings == "tell"
    mute = kind.build is _nothing and kind.triple.startswith("ff") and not told
    silent = strings in ("nothing", "mislead")
    return Made(
        kind=name,
        place=place,
        strings=strings if kind.bus == "usb" else "nothing",
        default_serial=serial in DEFAULT_SERIALS,
        categories=frozenset(
            {"unknown", "bidirectional"}
            if mute and strings == "script"
            else {"unknown"}
            if mute or (kind.chip and silent)
            else kind.categories
        ),
        tools=frozenset(kind.tools),
        product=model if told else "",
    )


def _usb(tree: Tree, kind: _Kind, index: int, slot: int) -> str:
    path = f"{CONTROLLER}/1-{slot}"
    folder = tree.usb(path, f"{0x1F00 + index // 65536:04x}", f"{index % 65536:04x}")
    (folder / "bDeviceClass").write_text("00\n")
    described = {"bInterfaceNumber": "00", "bInterfaceClass": kind.triple[:2], "bInterfaceSubClass": kind.triple[2:4]}
    described["bInterfaceProtocol"] = kind.triple[4:]
    bound = {"DRIVER": kind.driver} if kind.driver else {}
    tree.bus(f"{path}/1-{slot}:1.0", "usb", described, **bound)
    return path


def _pci(tree: Tree, kind: _Kind, index: int, slot: int) -> str:
    path = f"pci0000:00/0000:{slot:02x}:00.0"
    ids = {"vendor": "0x1f00", "device": f"0x{index:04x}", "class": f"0x{kind.triple}"}
    tree.bus(path, "pci", ids, DRIVER=kind.driver)
    return path


def _other(tree: Tree, kind: _Kind, index: int, slot: int) -> str:
    names = {
        "i2c": (f"platform/i2c-{slot}/{slot}-{0x40 + index % 16:04x}", f"i2c:{kind.driver}"),
        "spi": (f"platform/spi{slot}/spi{slot}.0", f"spi:{kind.driver}"),
        "acpi": (f"LNXSYSTM:00/BNCH{index:04X}:00", f"acpi:BNCH{index:04X}:"),
        "platform": (f"platform/{kind.driver}{index}.{slot}", f"platform:{kind.driver}{index}"),
    }
    path, modalias = names[kind.bus]
    tree.bus(path, kind.bus, {"modalias": modalias, "name": kind.driver}, MODALIAS=modalias, DRIVER=kind.driver)
    return path


def wrong(root: Path, made: list[Made]) -> list[str]:
    """What the embedded agent makes of a generated host that is not true, and what of it a contract refuses.

    A line each, ``kind: what``; empty for a host of which all invariants hold.
    """
    probe: Any = probe_root(root)
    databases = IdDatabases(root)
    found = identify(probe, databases)
    interface = declare(found, BUDGET)
    known = Artifacts(probe=probe, identify=found, interface=interface, tools_budget=BUDGET)
    refused = [
        item
        for stage, value in (("probe", probe), ("identify", found), ("interface", interface))
        for item in check(stage, value, known, SCHEMAS)
    ]
    refused += serve_static(render(interface), interface)
    lines = [f"refused: {item.code} {item.summary}" for item in refused if item.severity is Severity.ERROR]
    annotated = {each["id"]: each for each in found["devices"]}
    tools = {(device, tool["name"]) for tool in interface["tools"] for device in tool["devices"]}
    cut = {each["id"] for each in interface["left_out"] if each["reason"] in ("tool_budget", "server_size")}
    for device in made:
        lines += [f"{device.kind}: {line}" for line in _untrue(device, probe["devices"], annotated, tools, cut)]
    return lines


def ids(root: Path) -> set[str]:
    """The ids of all devices of a host."""
    probe: Any = probe_root(root)
    return {each["id"] for each in probe["devices"]}


def _untrue(
    device: Made,
    units: list[dict[str, Any]],
    annotated: Mapping[str, dict[str, Any]],
    tools: set[tuple[str, str]],
    cut: set[str],
) -> Iterator[str]:
    own = [each for each in units if f"{each['instance']['sysfs']}/".startswith(f"/sys/devices/{device.place}/")]
    if not own:
        yield "not seen"
        return
    named = [annotated[each["id"]] for each in own if each["id"] in annotated]
    categories = {each["category"] for each in named}
    if categories.isdisjoint(device.categories):
        called = " | ".join(each["identified_as"] for each in named)
        yield f"category {sorted(categories)}, not one of {sorted(device.categories)}; it is called {called}"
    has = {tool for each in own for name, tool in tools if name == each["id"]}
    if device.tools and has.isdisjoint(device.tools) and cut.isdisjoint(each["id"] for each in own):
        yield f"tools {sorted(has)}, none of {sorted(device.tools)}"
    said = " | ".join(each["identified_as"] for each in named)
    if device.product and device.product.casefold() not in said.casefold():
        yield f"its strings tell {device.product}, and it is called {said}"
    if device.default_serial and own[0]["instance"]["strength"] == "strong":
        yield "a default serial number is taken for its own"
