"""Two hosts with the same kinds of devices: other serial numbers, ports, numbers, names, and not a byte of difference.

The second host is made from the text of an invented one: its buses and ports are counted the other way round, its
serial numbers and addresses are others of the same form, and whatever the kernel counts begins elsewhere.
"""

import re
from pathlib import Path

import embedded
import pytest
from hosts.plant import HERE, plant

from octoform.contracts.canonical import output_digest

ROOT = Path(__file__).resolve().parents[2]
HOSTS = ("bench", "hostile", "laptop", "raspberry", "server")
SERIAL = re.compile(r"(?:serial=|HID_UNIQ=|ID_SERIAL_SHORT=)([0-9A-Za-z][\w-]{5,})")
ADDRESS = re.compile(r"(?<![0-9a-f:])(?:[0-9a-f]{2}:){5}[0-9a-f]{2}(?![0-9a-f:])", re.IGNORECASE)
COUNTED = re.compile(r"(?<![A-Za-z])(ttyUSB|ttyACM|hwmon|input|event|video|mouse|js|hidraw|rtc)(\d+)(?![\w-])")
NAMES = re.compile(r"(?<=^file /proc/sys/kernel/hostname\n)(  \| ?)(\S+)", re.MULTILINE)


def exchanged(text: str) -> str:
    """Other digits and letters of the same kind; leading zeros and such stay where they are."""
    return text.translate(str.maketrans("123456789ABCDEFabcdef", "987654321FEDCBAfedcba"))


def another(text: str) -> str:
    """The text of a host with the same kinds of devices."""
    for serial in {found for found in SERIAL.findall(text) if any(map(str.isdigit, found))}:
        text = text.replace(serial, exchanged(serial))
    text = ADDRESS.sub(lambda found: f"02:{exchanged(found[0])[3:]}", text)
    text = re.sub(r"(?<![\w.:-])(\d)-(\d+)(?=[.:/\s]|$)", lambda port: f"{int(port[1]) + 4}-{40 - int(port[2])}", text)
    text = re.sub(r"(?<=/usb)(\d)(?=[/\s])", lambda bus: str(int(bus[1]) + 4), text)
    text = re.sub(r"(?<=usb:)(\d)-(\d+)", lambda port: f"{int(port[1]) + 4}-{40 - int(port[2])}", text)
    text = re.sub(r"(:[0-9A-F]{4}:[0-9A-F]{4}\.)(\d{4})", lambda hid: f"{hid[1]}{99 - int(hid[2]):04d}", text)
    text = COUNTED.sub(lambda name: f"{name[1]}{int(name[2]) + 20}", text)
    return NAMES.sub(lambda name: f"{name[1]}another-name-9", text)


@pytest.mark.parametrize("name", HOSTS)
def test_the_artifacts_behind_probe_are_equal_byte_by_byte(name: str, tmp_path: Path) -> None:
    text = (HERE / f"{name}.host").read_text()
    moved = another(text)
    first = plant(name, tmp_path / "first")
    second = plant(name, tmp_path / "second", {text: moved})
    one, two = embedded.committed(first), embedded.committed(second)
    digests = [output_digest("probe", probe, ROOT / "protocol" / "schemas") for probe in (one, two)]
    assert digests[0] == digests[1]
    assert embedded.after_probe(one, first) == embedded.after_probe(two, second)
    if name != "hostile":
        assert [device["instance"] for device in one["devices"]] != [device["instance"] for device in two["devices"]]


def test_the_second_host_is_another_one() -> None:
    text = another((HERE / "bench.host").read_text())
    for gone in ("HW-12-0042", "1-10:", "/usb1/", "ttyUSB0", "4055-0a-0b-0c-0d", "C52B.0003"):
        assert gone not in text
    assert "/usb5/5-39/5-39:1.0/ttyUSB20" in text
