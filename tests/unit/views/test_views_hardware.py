"""Modaliases for people: one line a device, and classes as counts."""

import pytest

from octoform.plan.model import Action, Change
from octoform.views.plan_text import Line, describe, lines


def came(name: str) -> Change:
    return Change("hardware", name, Action.CREATE)


def went(name: str) -> Change:
    return Change("hardware", name, Action.DESTROY)


@pytest.mark.parametrize(
    ("announced", "words"),
    [
        ("usb:v0A0Ap0001d0100dc00dsc00dp00icFFisc00ip00in00", "USB device 0a0a:0001"),
        ("pci:v00000A0Ad00000001sv00000A0Asd00000001bc02sc00i00", "PCI device 0a0a:0001"),
        ("hid:b0003g0001v00000A0Ap00000001", "HID device 0a0a:0001"),
        ("acpi:ABC0001:", "ACPI device ABC0001"),
        ("spi:lamp", "spi device lamp"),
        ("virtio:", "virtio device (unnamed)"),
        ("scsi:t-0x00", "SCSI disk"),
        ("scsi:t-0x1e", "SCSI device t-0x1e"),
        ("nothing known", "nothing known device (unnamed)"),
    ],
)
def test_a_device_in_words(announced: str, words: str) -> None:
    assert describe(announced) == words


def test_the_parts_of_one_device_are_one_line() -> None:
    parts = [came(f"usb:v0A0Ap0001d0100dc00dsc00dp00icFFisc00ip00in0{number}") for number in range(3)]
    assert lines(parts) == [Line(Action.CREATE, "USB device 0a0a:0001")]


def test_a_class_is_told_as_counts_after_the_devices() -> None:
    found = lines([came("class:video4linux:2"), came("class:leds:1"), went("class:video4linux:1"), came("spi:lamp")])
    assert found == [
        Line(Action.CREATE, "spi device lamp"),
        Line(Action.CREATE, "class leds: 0 -> 1"),
        Line(Action.UPDATE, "class video4linux: 1 -> 2"),
    ]
