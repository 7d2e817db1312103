"""What acts through a line that carries bytes and no meaning rests on a profile, or on the word of the owner."""

import copy
from dataclasses import replace
from typing import Any

import pytest
from cases import for_each
from unit.contracts.contract_samples import IDENTIFY, INTERFACE, PROBE, READ, SCHEMAS, artifacts

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.diagnostics import Diagnostic

_NUMBER = {"type": "number", "minimum": 0}
CODE = "IDENTIFY-ACTUATE-WITHOUT-PROFILE"
LINE = "usb-1234-0003"


def identified(
    classes: list[str], effect: str = "actuate", answers: dict[str, str] | None = None, **device: Any
) -> tuple[dict[str, Any], Artifacts]:
    """IDENTIFY's artifact with a device of these classes that an agent declares able to move a joint."""
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
    return value, artifacts(probe=probe, answers=answers or {})


def found(classes: list[str], effect: str = "actuate", **more: Any) -> list[str]:
    """The codes for such a device."""
    return [item.code for item in check("identify", *identified(classes, effect, **more), SCHEMAS, "output.json")]


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


def answered(answer: str, *more: dict[str, str], **device: Any) -> tuple[dict[str, Any], Artifacts]:
    """IDENTIFY's artifact with the arm on a serial line, named by this answer, with more evidence."""
    evidence = [{"quote": "Acme Arm"}, *more]
    return identified(["tty"], answers={LINE: answer}, method="user_answer", evidence=evidence, **device)


LIMITS, STOP = "limits", "how it stops"
# An answer that is no source of what acts, and what it lacks.
THIN: dict[str, tuple[str, list[str]]] = {
    "a name alone": ("an Acme Arm with servos", [LIMITS, STOP]),
    "limits alone": ("an Acme Arm: MOVE n, 0 to 100", [STOP]),
    "a stop alone": ("an Acme Arm that STOP stops", [LIMITS]),
    "the settings of the line": ("an Acme Arm, 115200 baud, 8N1, 1 stop bit", [LIMITS, STOP]),
    "a number in the model": ("an Acme Arm 101, STOP halts it", [LIMITS]),
    "its ids and its firmware": ("an Acme Arm, usb-2341-8040, 1a86:7523, firmware 2, STOP halts it", [LIMITS]),
    "a number of joints": ("an Acme Arm with 6 joints and 2 grippers, torque off", [LIMITS]),
    "a stop that is not there": ("an Acme Arm, at most 30 degrees; there is no stop", [STOP]),
    "what does not stop": ("an Acme Arm, -90..90, it does not stop", [STOP]),
    "a stop that is unknown": ("an Acme Arm, -90..90, unknown how to stop it", [STOP]),
    "off the shelf": ("an off-the-shelf Acme Arm, at most 30 degrees", [STOP]),
    "another language without its words": ("ein Acme Arm, 0 bis 100, S bremst", [STOP]),
}
GERMAN = {"quote": "S bremst", "says": "'bremst' is German for: it stops"}
FULL: dict[str, tuple[str, tuple[dict[str, str], ...]]] = {
    "a range and a command": ("an Acme Arm: MOVE n, 0 to 4095; STOP stops it", ()),
    "most, and the emergency stop": ("an Acme Arm, at most 30 degrees. The red button is the emergency stop.", ()),
    "a range of two dots": ("an Acme Arm, -90..90, torque off lets go", ()),
    "a range with a hyphen": ("an Acme Arm, pulses of 1000-2000 us, release with R", ()),
    "on and off": ("Acme Arm, a relay, on and off only", ()),
    "channels and a pulse": ("Acme Arm with eight relays, pulses of 500 ms, each goes off again", ()),
    "a sign and a unit": ("an Acme Arm, \u00b145\u00b0, pull the power: it halts", ()),
    "between two": ("an Acme Arm between 10 and 90 mm, HALT stops it", ()),
    "most, shortened": ("an Acme Arm, max. 30, H stops it", ()),
    "what it must not exceed": ("an Acme Arm, do not exceed 90; H stops it", ()),
    "channels with a hyphen": ("Acme Arm, an 8-channel board, power off releases", ()),
    "a pair in brackets": ("an Acme Arm, position in [0, 100], H stops it", ()),
    "what is denied is another thing": ("an Acme Arm, not above 90; H stops it", ()),
    "another language": ("ein Acme Arm, 0 bis 100, Not-Aus", ()),
    "another language's noun": ("ein Acme Arm, 0 bis 100, Stopp mit S", ()),
    "another language, translated": ("ein Acme Arm, 0 bis 100, S bremst", (GERMAN,)),
}


@for_each("case", THIN)
def test_an_answer_that_only_names_the_device_is_no_source_of_what_acts(case: str) -> None:
    answer, lacks = THIN[case]
    [finding] = check("identify", *answered(answer), SCHEMAS, "output.json")
    assert finding.code == CODE and str(finding.summary).endswith(f"lacks {' and '.join(lacks)}"), finding
    assert f"`octoform answer {LINE}" in str(finding.hint) and f"`octoform profile new {LINE}`" in str(finding.hint)


@for_each("case", FULL)
def test_an_answer_with_limits_and_how_it_stops_is_enough(case: str) -> None:
    answer, more = FULL[case]
    assert check("identify", *answered(answer, *more), SCHEMAS, "output.json") == []


def test_a_word_is_a_stop_only_where_the_answer_has_it_and_a_language_is_named() -> None:
    answer = "ein Acme Arm, 0 bis 100, S bremst"
    for evidence in ({**GERMAN, "says": "it stops"}, {**GERMAN, "says": "'bremst' is German for slow"}):
        assert CODE in [item.code for item in check("identify", *answered(answer, evidence), SCHEMAS, "output.json")]


def test_such_an_answer_is_enough_for_a_reading_and_beside_a_class() -> None:
    named: dict[str, Any] = {
        "method": "user_answer",
        "evidence": [{"quote": "Acme Arm"}],
        "answers": {LINE: "an Acme Arm"},
    }
    assert found(["tty"], "read", **named) == found(["leds"], **named) == []


MOVES = "an Acme Arm: MOVE n, 0 to 100; STOP stops it"
READS = {"name": "read_joint", "via": "a serial library", "effect": "read"}


@pytest.mark.parametrize(
    ("answer", "description", "refused"),
    [
        ("an Acme Arm", "Read where each joint is", False),
        ("an Acme Arm", "Enable torque, then read the place of each joint", True),
        (MOVES, "Enable torque, then read the place of each joint", False),
    ],
)
def test_an_answer_that_bounds_nothing_lets_no_read_speak_of_moving(
    answer: str, description: str, refused: bool
) -> None:
    """What must not be declared as acting is not served as one that reads."""
    value, given = answered(answer, capabilities=[{**READS, "description": description}])
    diagnostics = [
        item for item in check("identify", value, given, SCHEMAS, "output.json") if "READ-MOVES" in item.code
    ]
    assert [item.code for item in diagnostics] == (["IDENTIFY-READ-MOVES"] if refused else [])
    assert all("with limits" in str(item.hint) for item in diagnostics)


@pytest.mark.parametrize(("answer", "refused"), [("an Acme Arm", True), (MOVES, False)])
def test_such_an_answer_lets_no_tool_that_reads_take_a_goal(answer: str, refused: bool) -> None:
    value = copy.deepcopy(INTERFACE)
    value["left_out"] = [item for item in value["left_out"] if item["id"] != LINE]
    tool: dict[str, Any] = {"name": "read_joint", "capability": "read_joint", "devices": [LINE], "effect": "read"}
    tool |= {"description": "Read where the joint of the arm is, in degrees.", "annotations": READ}
    place = {"type": "number", "minimum": 0, "maximum": 100, "description": "where to, in degrees"}
    tool["input_schema"] = {"type": "object", "properties": {"position": place}, "required": ["position"]}
    tool["input_schema"]["additionalProperties"] = False
    tool["output_schema"] = {"type": "object", "properties": {"place_degrees": {"type": "number"}}}
    value["tools"].append(tool)
    before, known = answered(answer, capabilities=[{**READS, "description": "Read where each joint is"}])
    diagnostics = check("interface", value, replace(known, identify=before), SCHEMAS, "output.json")
    assert ("INTERFACE-READ-MOVES" in [item.code for item in diagnostics]) is refused


def declared(answer: str, schema: dict[str, Any], name: str = "position", holds: str = "") -> list[Diagnostic]:
    """The findings on a tool that moves the answered arm to a place with this schema."""
    value = copy.deepcopy(INTERFACE)
    value["left_out"] = [item for item in value["left_out"] if item["id"] != LINE]
    tool: dict[str, Any] = {"name": "move_joint", "capability": "move_joint", "devices": [LINE], "effect": "actuate"}
    tool |= {"description": "Move a joint of the arm.", "annotations": {**READ, "readOnlyHint": False}}
    properties = {name: {"type": "number", "description": "where to, in units of the device", **schema}}
    tool["input_schema"] = {"type": "object", "properties": properties, "required": [name]}
    tool["input_schema"]["additionalProperties"] = False
    tool["output_schema"] = {"type": "object", "properties": {"state": {"type": "string"}}}
    value["tools"].append(tool)
    before, known = answered(answer)
    profiles = {**known.profiles, holds: ProfileFacts(holds, frozenset({LINE}))} if holds else known.profiles
    return check("interface", value, replace(known, identify=before, profiles=profiles), SCHEMAS, "output.json")


# The answer, the schema of the argument, and its name.
FROM_MEMORY: dict[str, tuple[str, dict[str, Any], str]] = {
    "the range of another servo": (MOVES, {"minimum": 0, "maximum": 4095}, "position"),
    "below it": (MOVES, {"minimum": -100, "maximum": 100}, "position"),
    "one beyond": (MOVES, {"minimum": 0, "maximum": 101}, "position"),
    "an exclusive end": (MOVES, {"minimum": 0, "exclusiveMaximum": 4096}, "position"),
    "a choice of numbers": (MOVES, {"enum": [0, 50, 900]}, "position"),
    "items of a list": (MOVES, {"type": "array", "maxItems": 6, "items": _NUMBER | {"maximum": 180}}, "position"),
    "the baud rate": (f"{MOVES}; 115200 baud", {"minimum": 0, "maximum": 115200}, "position"),
    "from nothing, where the range begins above": (
        "an Acme Arm between 10 and 90 mm, HALT stops it",
        {"minimum": 0, "maximum": 90},
        "position",
    ),
    "the other way": ("an Acme Arm, at most 30 degrees, H halts", {"minimum": -30, "maximum": 30}, "position"),
    "more channels": ("Acme Arm with eight relays, off", {"type": "integer", "minimum": 1, "maximum": 16}, "relay"),
    "a decimal comma as one of thousands": (
        "ein Acme Arm, 0 bis 1,5 m, Not-Aus",
        {"minimum": 0, "maximum": 1500},
        "position",
    ),
    "a level of what is on or off": ("Acme Arm, a relay, on and off", {"minimum": 0, "maximum": 100}, "level"),
}
OF_THE_ANSWER: dict[str, tuple[str, dict[str, Any], str]] = {
    "its range": (MOVES, {"minimum": 0, "maximum": 100}, "position"),
    "a narrower one": (MOVES, {"minimum": 10, "maximum": 60}, "position"),
    "a choice within": (MOVES, {"enum": [0, 50, 100]}, "position"),
    "most, from nothing": ("an Acme Arm, at most 30 degrees, H halts", _NUMBER | {"maximum": 30}, "position"),
    "both ways": ("an Acme Arm, 30 degrees either way, H halts", {"minimum": -30, "maximum": 30}, "position"),
    "channels in words": ("Acme Arm with eight relays, off", {"type": "integer", "minimum": 1, "maximum": 8}, "relay"),
    "a switch": ("Acme Arm, a relay, on and off", {"type": "boolean"}, "on"),
    "how long a call waits": (MOVES, {"minimum": 1, "maximum": 60}, "timeout_seconds"),
    "in thousands": ("an Acme Arm, 0 to 4,095; STOP stops it", {"minimum": 0, "maximum": 4095}, "position"),
    "with a decimal comma": ("ein Acme Arm, 0 bis 1,5 m, Not-Aus", {"minimum": 0, "maximum": 1.5}, "position"),
}
RANGE = "INTERFACE-RANGE-UNFOUNDED"


@for_each("case", FROM_MEMORY)
def test_a_range_that_the_answer_does_not_hold_is_refused(case: str) -> None:
    answer, schema, name = FROM_MEMORY[case]
    [finding] = [item for item in declared(answer, schema, name) if item.code == RANGE]
    assert "numbers of the answer" in str(finding.hint) and f"`octoform answer {LINE}" in str(finding.hint)
    assert RANGE not in [item.code for item in declared(answer, schema, name, holds="arm")], "a profile bounds it"


@for_each("case", OF_THE_ANSWER)
def test_the_numbers_of_the_answer_and_narrower_ones_are_right(case: str) -> None:
    assert declared(*OF_THE_ANSWER[case]) == []


def test_a_profile_that_does_not_hold_is_one_finding_and_not_two() -> None:
    assert found(["tty"], profile="lamp", method="profile") == ["IDENTIFY-PROFILE-EVIDENCE"]
