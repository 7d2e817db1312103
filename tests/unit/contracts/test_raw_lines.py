"""What acts through a line that carries bytes and no meaning rests on a profile, or on the word of the owner."""

import copy
from typing import Any

import pytest
from unit.contracts.contract_samples import IDENTIFY, PROBE, SCHEMAS, artifacts

from octoform.contracts.contract_check import check

CODE = "IDENTIFY-ACTUATE-WITHOUT-PROFILE"
LINE = "usb-1234-0003"


def found(
    classes: list[str], effect: str = "actuate", answers: dict[str, str] | None = None, **device: Any
) -> list[str]:
    """The codes for a device with these classes that an agent declares able to move a joint."""
    probe, value = copy.deepcopy(PROBE), copy.deepcopy(IDENTIFY)
    probe["devices"][3] |= {"classes": classes, "name": "Acme Arm", "raw_descriptor": "product: Acme Arm"}
    verb = "read" if effect == "read" else "move"
    moves = {"name": f"{verb}_joint", "description": "A joint", "via": "a serial library", "effect": effect}
    value["devices"][3] = {
        "id": LINE,
        "identified_as": "Acme Arm",
        "category": "bidirectional",
        "confidence": 0.9,
        "method": "descriptor_strings",
        "evidence": [{"quote": "product: Acme Arm"}],
        "capabilities": [moves],
        **device,
    }
    known = artifacts(probe=probe, answers=answers or {})
    return [item.code for item in check("identify", value, known, SCHEMAS, "output.json")]


@pytest.mark.parametrize(
    "classes", [[], ["tty"], ["hidraw"], ["i2c-dev", "i2c-adapter"], ["spidev"], ["tty", "hidraw"], ["usbmisc"]]
)
@pytest.mark.parametrize("effect", ["actuate", "irreversible"])
def test_what_acts_through_a_raw_line_needs_a_profile(classes: list[str], effect: str) -> None:
    assert found(classes, effect) == [CODE]


@pytest.mark.parametrize("classes", [["tty"], ["hidraw"]])
def test_a_reading_needs_none(classes: list[str]) -> None:
    assert found(classes, "read") == []


def test_without_any_class_there_is_no_way_to_read_either() -> None:
    assert found([], "read") == ["IDENTIFY-CAPABILITY-WITHOUT-CLASS"]


@pytest.mark.parametrize("classes", [["leds"], ["tty", "video4linux"], ["hidraw", "input"], ["gpio"], ["pwm"]])
def test_a_class_of_the_kernel_gives_ranges_and_meaning(classes: list[str]) -> None:
    assert found(classes) == []


def test_the_word_of_the_owner_is_enough() -> None:
    answer = {LINE: "an Acme Arm: MOVE n, 0 to 100"}
    quoted = [{"quote": "Acme Arm"}]
    assert found(["tty"], answers=answer, method="user_answer", evidence=quoted) == []


def test_a_profile_that_does_not_hold_is_one_finding_and_not_two() -> None:
    assert found(["tty"], profile="lamp", method="profile") == ["IDENTIFY-PROFILE-EVIDENCE"]
