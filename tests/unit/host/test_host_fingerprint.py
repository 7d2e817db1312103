"""The fingerprint: what counts as hardware, what does not, and that it is light and reads text only."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.host import difference, fingerprint, root_from_environment

Planted = Callable[..., Path]
HEAVY = ("pydantic", "jsonschema", "ruamel", "jinja2", "rich", "git", "asyncio", "subprocess", "socket")


def grown(root: Path, kind: str, path: str) -> None:
    """Add a device to a planted tree."""
    device = root / "sys/devices" / path
    device.mkdir(parents=True)
    folder = root / "sys" / kind
    folder.mkdir(parents=True, exist_ok=True)
    (folder / device.name).symlink_to(os.path.relpath(device, folder))


def test_it_names_what_the_kernel_announces(planted: Planted) -> None:
    found = fingerprint(planted("laptop"))
    assert found.entries == tuple(sorted(found.entries))
    assert "usb:v1D9Cp0C14d0102dcEFdsc02dp01ic0Eisc01ip00in00" in found.entries
    assert {"class:video4linux:2", "class:sound:1", "class:block:1", "class:thermal:2"} <= set(found.entries)
    assert (found.os, found.arch) == ("linux", "x86_64")
    assert found.digest.startswith("sha256:")


def test_iio_devices_and_gpio_chips_count(planted: Planted) -> None:
    assert {"class:iio:1", "class:gpio:1"} <= set(fingerprint(planted("raspberry")).entries)


def test_the_same_host_has_the_same_digest(planted: Planted) -> None:
    assert fingerprint(planted("laptop")) == fingerprint(planted("laptop"))


def test_two_identical_boards_count_twice(planted: Planted) -> None:
    entries = fingerprint(planted("bench")).entries
    assert entries.count("usb:v1A86p7523d0264dcFFdsc00dp00icFFisc01ip02in00") == 2


@pytest.mark.parametrize(
    ("kind", "path"),
    [
        ("class/block", "virtual/block/loop99"),
        ("block", "virtual/block/loop99"),
        ("class/block", "pci0000:00/0000:00:1d.0/0000:01:00.0/nvme/nvme0/nvme0n1/nvme0n1p7"),
        ("class/net", "virtual/net/veth1234"),
        ("class/tty", "virtual/tty/ptyp9"),
        ("class/wakeup", "pci0000:00/0000:00:14.0/wakeup/wakeup7"),
        ("class/input", "virtual/input/input77"),
        ("class/bdi", "virtual/bdi/7:99"),
        ("class/leds", "virtual/leds/made-by-hand"),
        ("class/sound", "pci0000:00/0000:00:1f.3/sound/card0/pcmC0D9p"),
        ("class/bluetooth", "pci0000:00/x/bluetooth/hci0/hci0:12"),
        ("bus/hid/devices", "virtual/misc/uhid/0005:1DEE:0001.0009"),
        ("bus/cpu/devices", "system/cpu/cpu9"),
    ],
)
def test_what_comes_and_goes_without_hardware_does_not_count(kind: str, path: str, planted: Planted) -> None:
    root = planted("laptop")
    before = fingerprint(root)
    grown(root, kind, path)
    (root / "sys/devices" / path / "modalias").write_text("made:by-a-program\n")
    assert fingerprint(root) == before


@pytest.mark.parametrize(
    ("kind", "path", "appeared", "gone"),
    [
        ("class/tty", "pci0000:00/0000:00:14.0/usb1/1-7/tty/ttyACM3", ("class:tty:1",), ()),
        ("class/thermal", "virtual/thermal/thermal_zone8", ("class:thermal:3",), ("class:thermal:2",)),
        ("class/hwmon", "platform/fan.1/hwmon/hwmon9", ("class:hwmon:2",), ("class:hwmon:1",)),
        ("block", "pci0000:00/0000:00:14.0/usb1/1-7/block/sdq", ("class:block:2",), ("class:block:1",)),
    ],
)
def test_hardware_that_appears_is_named(
    kind: str, path: str, appeared: tuple[str, ...], gone: tuple[str, ...], planted: Planted
) -> None:
    root = planted("laptop")
    before = fingerprint(root)
    grown(root, kind, path)
    after = fingerprint(root)
    assert after.digest != before.digest
    assert difference(before.entries, after.entries) == (appeared, gone)


def test_a_port_or_a_number_is_no_difference(planted: Planted) -> None:
    moved = planted("bench", {"usb1/1-10": "usb1/1-4", "/1-10:1.": "/1-4:1.", "ttyUSB1": "ttyUSB7"})
    assert fingerprint(moved) == fingerprint(planted("bench"))


def test_hostile_modalias_stays_one_entry(planted: Planted) -> None:
    root = planted("laptop")
    grown(root, "bus/usb/devices", "pci0000:00/evil")
    (root / "sys/devices/pci0000:00/evil/modalias").write_bytes(b"usb:\xff\xfe\nclass:video4linux:99\n")
    assert "usb:\\xff\\xfe" in fingerprint(root).entries
    assert "class:video4linux:99" not in fingerprint(root).entries


def test_an_empty_folder_has_a_fingerprint(tmp_path: Path) -> None:
    found = fingerprint(tmp_path)
    assert (found.os, found.arch, found.entries) == ("unknown", "unknown", ())


def test_a_system_that_announces_nothing_in_files_has_one_all_the_same(planted: Planted) -> None:
    assert fingerprint(planted("macos-studio")).entries == ()
    assert fingerprint(planted("wsl2")).entries == ("class:net:1", "vmbus:635161f83edfc546913ff2d2f965ed0e")


def test_the_running_host_is_told_by_its_kernel() -> None:
    found = fingerprint(Path("/"))
    assert (found.os, found.arch) == (os.uname().sysname.lower(), os.uname().machine)


@given(st.lists(st.sampled_from("abc")), st.lists(st.sampled_from("abc")))
def test_difference_is_what_turns_one_into_the_other(before: list[str], after: list[str]) -> None:
    appeared, gone = difference(before, after)
    assert sorted([*before, *appeared]) == sorted([*after, *gone])
    assert difference(after, before) == (gone, appeared)


def test_the_root_comes_from_the_environment() -> None:
    assert root_from_environment({}) == Path("/")
    assert root_from_environment({"OCTOFORM_SYSROOT": ""}) == Path("/")
    assert root_from_environment({"OCTOFORM_SYSROOT": "/recorded"}) == Path("/recorded")


def test_it_imports_nothing_heavy() -> None:
    code = "import sys, octoform.host; print(*sorted(name.split('.')[0] for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert set(done.stdout.split()) & set(HEAVY) == set()
