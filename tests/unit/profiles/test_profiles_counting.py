"""A line protocol that can neither report its position nor stop: its definition of both, and what is refused."""

from pathlib import Path

import pytest

from octoform.profiles import commands, for_task, load_text

RAIL = (Path(__file__).parents[3] / "profiles" / "camera-rail.md").read_text()
X = "x: {tool: rail_move_x, parameter: steps}"


def test_counting_and_stopping_are_commands_after_the_others() -> None:
    profile, found = load_text(RAIL, "x")
    assert profile is not None and found == []
    lines = [(item["tool"], item.get("do"), item["effect"]) for item in commands(profile)]
    assert lines[3:] == [("rail_position", "position", "read"), ("rail_stop", "stop", "actuate")]
    assert [item["parameters"] for item in commands(profile)[3:]] == [{}, {}]
    grammar = for_task(profile, {"usb-x"})["grammar"]
    steps = {"parameter": "steps"}
    axes = {"x": {"tool": "rail_move_x", **steps}, "y": {"tool": "rail_move_y", **steps}}
    assert (grammar["position"]["axes"], grammar["position"]["zero"]) == (axes, "rail_home")
    assert (grammar["stop"]["tool"], grammar["stop"]["until"]) == ("rail_stop", "rail_home")
    assert profile.describes


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("    zero: rail_home\n", "", "None is no command of this protocol definition"),
        ("    zero: rail_home\n", "    zero: rail_hom\n", "did you mean 'rail_home'"),
        ("    zero: rail_home\n", "    zero: rail_move_x\n", "takes parameters, so it is no origin"),
        ("    until: rail_home\n", "    until: rail_hom\n", "did you mean 'rail_home'"),
        ("    until: rail_home\n", "    untill: rail_home\n", "did you mean 'until'"),
        ("    tool: rail_position\n", "    tool: rail_move_x\n", "occurs twice"),
        ("    tool: rail_stop\n", "    tool: rail_position\n", "occurs twice"),
        ("    tool: rail_stop\n", "    tool: stop\n", "no usable tool name"),
        (X, "x: {tool: rail_move_z, parameter: steps}", "is no command of this protocol definition"),
        (X, "x: {tool: rail_move_x, parameter: step}", "did you mean 'steps'"),
        (X, "x: {tool: rail_move_y, parameter: steps}", "two axes count the same"),
        (X, "X: {tool: rail_move_x, parameter: steps}", "no usable name of an axis"),
        (f"axes: {{{X}, y: {{tool: rail_move_y, parameter: steps}}}}", "axes: {}", "1 to 12 axes"),
        ("effect: actuate\n---", "effect: read\n---", "is a read and moves nothing"),
    ],
)
def test_what_is_refused(old: str, new: str, says: str) -> None:
    assert old in RAIL
    profile, found = load_text(RAIL.replace(old, new, 1), "x")
    assert profile is None
    assert any(says in f"{item.summary} {item.hint}" for item in found if item.code == "PROFILE-GRAMMAR"), found
    assert all(item.span is not None for item in found)


def test_what_is_summed_up_is_a_number() -> None:
    words = RAIL.replace(
        '{type: integer, minimum: -2000, maximum: 2000, unit: steps, about: "steps, negative is back"}',
        "{type: string, enum: [far, near]}",
    )
    profile, found = load_text(words, "x")
    assert profile is None and any("no number that could be added up" in item.summary for item in found)
