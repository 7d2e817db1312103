"""The kernel's compact codes and the text rules: bit maps, usages, monitor names, escapes, slugs, order."""

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.builtin.probe import capabilities, kernel_text
from octoform.builtin.probe.sysfs import device_path
from octoform.builtin.probe.udev import split_joined


@given(st.text())
def test_visible_text_is_printable_and_says_printable_text_unchanged(said: str) -> None:
    assert kernel_text.visible(said).isprintable()
    assert kernel_text.visible(kernel_text.visible(said)) == kernel_text.visible(said)


@given(st.binary())
def test_any_bytes_become_one_bounded_line(data: bytes) -> None:
    shown = kernel_text.value(data.decode("utf-8", "surrogateescape"))
    assert len(shown) <= kernel_text.VALUE_CHARS and shown.isprintable()
    shown.encode("utf-8")


@given(st.text())
def test_a_slug_is_legal_in_an_id(said: str) -> None:
    assert set(kernel_text.slug(said)) <= set(string.ascii_lowercase + string.digits + "-")
    assert not kernel_text.slug(said).startswith("-") and not kernel_text.slug(said).endswith("-")


def test_escapes_are_visible() -> None:
    assert kernel_text.visible("a\x1bb\u202ec\udcffd\U000e0001") == "a\\x1bb\\u202ec\\xffd\\U000e0001"


def test_a_cut_is_marked() -> None:
    assert kernel_text.value("A" * 10_000).endswith("A [cut]")


def test_natural_order() -> None:
    assert sorted(["hwmon10", "hwmon2", "hwmon"], key=kernel_text.natural) == ["hwmon", "hwmon2", "hwmon10"]


@pytest.mark.parametrize(
    ("bits", "kinds"),
    [
        ({"ev": "120013", "key": "402000000 3803078f800d001 feffffdfffefffff fffffffffffffffe"}, "keyboard"),
        ({"ev": "17", "key": "ffff0000 0 0 0 0", "rel": "1943"}, "mouse"),
        ({"ev": "b", "key": "e520 10000 0 0 0 0", "abs": "2e0800000000003", "prop": "5"}, "touchpad"),
        ({"ev": "b", "key": "400 0 0 0 0 0", "abs": "260800000000003", "prop": "2"}, "touchscreen"),
        ({"ev": "b", "key": "1c03 0 0 0 0 0", "abs": "1000003", "prop": "1"}, "tablet"),
        ({"ev": "b", "key": "7fdb000000000000 0 0 0 0", "abs": "3003f"}, "gamepad"),
        ({"ev": "9", "abs": "7", "prop": "40"}, "accelerometer"),
        ({"ev": "21", "sw": "1"}, "switch"),
        ({"ev": "3", "key": "10000000000000 0"}, "buttons"),
        ({"ev": "not hexadecimal"}, ""),
    ],
)
def test_capability_bits_amount_to_kinds(bits: dict[str, str], kinds: str) -> None:
    numbers = {kind: capabilities.bitmap(bits.get(kind, "")) for kind in ("ev", "key", "rel", "abs", "sw", "prop")}
    assert capabilities.input_kinds(numbers) == kinds


def test_hid_usages_of_top_level_collections() -> None:
    fido = bytes.fromhex("06d0f10901a1010920c0")
    assert capabilities.hid_usages(fido) == ["f1d0/0001"]
    two = bytes.fromhex("05010906a101050709e0c0050c0901a101c0")
    assert capabilities.hid_usages(two) == ["0001/0006", "000c/0001"]


@given(st.binary(max_size=200))
def test_any_bytes_are_a_report_descriptor_or_an_edid_without_harm(data: bytes) -> None:
    assert all(len(usage) >= 9 for usage in capabilities.hid_usages(data))
    capabilities.edid_names(b"\x00\xff\xff\xff\xff\xff\xff\x00" + data)


def test_a_joined_name_gives_up_its_serial_number() -> None:
    known = {"ID_SERIAL": "Heron_Stepper_HW-12", "ID_SERIAL_SHORT": "HW-12"}
    split_joined(known)
    assert known == {"ID_SERIAL.name": "Heron_Stepper", "ID_SERIAL_SHORT": "HW-12"}
    guessed = {"ID_SERIAL": "Heron_Stepper_00AB45CD99"}
    split_joined(guessed)
    assert guessed == {"ID_SERIAL.name": "Heron_Stepper", "ID_SERIAL_SHORT": "00AB45CD99"}
    plain = {"ID_SERIAL": "Heron_Stepper_Plus"}
    split_joined(plain)
    assert plain == {"ID_SERIAL.name": "Heron_Stepper_Plus"}


@pytest.mark.parametrize(
    ("link", "path"),
    [
        ("../../../devices/pci0000:00/x", "/sys/devices/pci0000:00/x"),
        ("/sys/devices/x", "/sys/devices/x"),
        ("../../../../etc", ""),
        ("../../devices/../../etc", ""),
        ("../../devices/x/..", ""),
        ("", ""),
    ],
)
def test_only_links_into_the_device_tree_count(link: str, path: str) -> None:
    assert device_path(link) == path
