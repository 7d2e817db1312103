"""How surely PROBE knows a specimen: by a number of its own, by its place, or by its kind alone."""

import pytest

from octoform.builtin.probe.device_units import entries
from octoform.builtin.probe.unit_model import Node, Unit, scrub


def board(port: str, serial: str, pid: str = "00c1") -> Unit:
    path = f"/sys/devices/pci0/usb1/{port}"
    return Unit(Node(path, "usb", False, kind=f"1f00-{pid}", vid="1f00", pid=pid, serial=serial))


def strengths(*units: Unit) -> list[str]:
    return [entry["instance"]["strength"] for entry in entries(units)]  # type: ignore[index]


def test_a_number_that_one_has_alone_is_strong_and_one_that_twins_share_is_none() -> None:
    assert strengths(board("1-1", "A5-0001")) == ["strong"]
    assert strengths(board("1-1", "A5-0001"), board("1-2", "A5-0001")) == ["positional", "positional"]
    assert strengths(board("1-1", "A5-0001"), board("1-2", "B7-0002")) == ["strong", "strong"]


def test_the_same_number_on_two_products_is_the_number_of_each() -> None:
    assert strengths(board("1-1", "A5-0001"), board("1-2", "A5-0001", "00c2")) == ["strong", "strong"]


@pytest.mark.parametrize("serial", ["", "0", "00000000", "ffffff", "0123456789ABCDEF", "123456789", "Default", "N/A"])
def test_what_makers_put_in_place_of_a_number_is_none(serial: str) -> None:
    assert strengths(board("1-1", serial)) == ["positional"]


def test_what_is_counted_in_the_order_of_discovery_has_no_place() -> None:
    chip = Unit(Node("/sys/devices/virtual/hwmon/hwmon3", "hwmon", True, kind="corechip"))
    lamp = Unit(Node("/sys/devices/virtual/leds/status", "leds", True, kind="status"))
    keys = Unit(Node("/sys/devices/virtual/misc/uhid/0005:1F00:0001.0004", "hid", False, vid="1f00", pid="0001"))
    assert sorted(strengths(chip, lamp, keys)) == ["positional", "weak", "weak"]


@pytest.mark.parametrize(
    "said", ["Otter Cam_SN:D744C4C5", "Otter Cam S/N 1: Serial No. #00-417-A2", "Otter, serial=8K1172"]
)
def test_a_number_that_is_called_a_serial_number_is_not_told(said: str) -> None:
    shown = scrub(said, [])
    assert shown.endswith("<serial>") and shown.startswith("Otter")


@pytest.mark.parametrize(
    "said", ["Serial: none", "USB Serial 2000", "SN65HVD", "serial number: unknown", "insn: 12345"]
)
def test_what_only_speaks_of_serial_stays(said: str) -> None:
    assert scrub(said, []) == said


@pytest.mark.parametrize(
    "serial", ["0001", "123456", "0123456789", "000000000000", "1234567890ABCDEF", "Serial Number"]
)
def test_a_default_number_is_no_identity_alone_or_beside_a_twin(serial: str) -> None:
    assert strengths(board("1-1", serial)) == ["positional"]
    assert strengths(board("1-1", serial), board("1-2", "A10KZP4X")) == ["positional", "strong"]


def test_short_numbers_count_where_twins_show_different_ones() -> None:
    assert strengths(board("1-1", "A5")) == ["positional"]
    assert strengths(board("1-1", "A5"), board("1-2", "B7")) == ["strong", "strong"]
    assert strengths(board("1-1", "A5"), board("1-2", "")) == ["positional", "positional"]


def test_a_number_that_repeats_the_product_is_none() -> None:
    unit = board("1-1", "Otter-X2 9000")
    unit.head.add("product", "Otter X2 9000")
    assert strengths(unit) == ["positional"]
