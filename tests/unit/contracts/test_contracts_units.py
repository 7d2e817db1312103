"""Which units of a device a tool acts on: said by each tool that actuates such a device, and fitting its parameters."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import pytest

from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.rules.interface.result_rules import channel_unit
from octoform.contracts.rules.interface.unit_rules import units_missing, units_wrong

Tool = dict[str, Any]
NAMES = {"pan": ["1"], "elbow": ["3"]}
MOVE: Tool = {
    "name": "move",
    "devices": ["arm"],
    "effect": "actuate",
    "input_schema": {"properties": {"joint": {"enum": ["pan", "elbow", "1", "3"]}, "position": {}}},
    "output_schema": {"properties": {"joint": {}, "position": {}, "all": {"items": {"properties": {"position": {}}}}}},
    "units": {
        "names": NAMES,
        "parameter": "joint",
        "goal": {"of": "position", "parameter": "position"},
        "reports": {"field": "position", "unit": "joint"},
    },
}
HOME: Tool = {
    "name": "home",
    "devices": ["arm"],
    "effect": "actuate",
    "input_schema": {},
    "units": {"names": NAMES, "goal": {"of": "position", "fixed": {"pan": 1, "elbow": 2}}},
}
LOOK: Tool = {"name": "look", "devices": ["arm"], "effect": "read", "input_schema": {}}
STOP: Tool = {**LOOK, "name": "stop", "effect": "actuate", "stops": True}
ELSEWHERE: Tool = {**LOOK, "name": "lamp", "effect": "actuate", "devices": ["lamp"]}


def codes(*tools: Tool, given: Artifacts | None = None) -> list[str]:
    value = {"tools": list(tools)}
    return [item.code for rule in (units_missing, units_wrong) for item in rule(value, given or Artifacts())]


def test_tools_that_say_which_units_they_act_on() -> None:
    assert codes(MOVE, HOME, LOOK, STOP, ELSEWHERE) == []


def test_a_tool_beside_them_that_does_not_say_so() -> None:
    silent = {name: each for name, each in HOME.items() if name != "units"}
    assert codes(MOVE, silent) == ["INTERFACE-UNITS-MISSING"] and codes(silent) == []


def test_units_that_the_profile_of_the_device_drives() -> None:
    facts = ProfileFacts("so", frozenset({"arm"}), (), ({"tool": "home", "do": "pose", "effect": "actuate"},))
    given = Artifacts(identify={"devices": [{"id": "arm", "profile": "so"}]}, profiles={"so": facts})
    silent = {name: each for name, each in HOME.items() if name != "units"}
    assert codes(silent, LOOK, STOP, given=given) == ["INTERFACE-UNITS-MISSING"]
    assert codes(HOME, LOOK, STOP, given=given) == []


WRONG: dict[str, Callable[[Tool], Any]] = {
    "a parameter that is none": lambda units: units.update(parameter="axis"),
    "a goal of no parameter": lambda units: units["goal"].update(parameter="place"),
    "a parameter for a unit that is none": lambda units: units.update(parameters={"position": "wrist"}),
    "one word for two": lambda units: units.update(names={"pan": ["1", "3"], "elbow": ["3"]}),
    "a word that means none": lambda units: units.update(names={"pan": ["1"], "elbow": []}),
    "a place of no unit": lambda units: units["goal"].update(fixed={"pan": 1, "elbow": 2, "wrist": 3}),
    "a report by no member": lambda units: units["reports"].update(field="place"),
    "a report of no one knows which unit": lambda units: units["reports"].pop("unit"),
    "a report by no list": lambda units: units["reports"].update(records="position"),
    "a list of no one knows which unit": lambda units: units.update(reports={"field": "position", "records": "all"}),
    "a list that does not name its units": lambda units: units["reports"].update(records="all"),
    "a unit without a place": lambda units: units["goal"].update(fixed={"pan": 1}),
    "a report without a goal": lambda units: units.pop("goal"),
}


@pytest.mark.parametrize("change", WRONG.values(), ids=WRONG)
def test_units_that_do_not_fit_the_tool(change: Callable[[Tool], Any]) -> None:
    tool = deepcopy(MOVE)
    change(tool["units"])
    assert {*codes(tool)} == {"INTERFACE-UNITS-WRONG"}


def test_the_cure_of_a_report_is_about_the_report() -> None:
    tool = deepcopy(MOVE)
    tool["units"]["reports"].pop("unit")
    [found] = units_wrong({"tools": [tool]}, Artifacts())
    assert "`reports.unit`" in str(found.hint) and "input_schema" not in str(found.hint)


@pytest.mark.parametrize(
    ("unit", "member", "effect", "expected"),
    [
        ("V", "value_celsius", "read", ["INTERFACE-CHANNEL-UNIT"]),
        ("V", "value_volts", "read", []),
        ("V", "value_celsius", "actuate", []),
        ("degF", "value_celsius", "read", []),
        ("K", "value_celsius", "read", []),
        ("degC", "value_fahrenheit", "read", []),
        ("hPa", "value_kpa", "read", []),
        ("hPa", "value_celsius", "read", ["INTERFACE-CHANNEL-UNIT"]),
    ],
)
def test_a_reading_is_in_a_unit_of_its_channels_whatever_it_is_called(
    unit: str, member: str, effect: str, expected: list[str]
) -> None:
    channels = [{"channel": "in0", "unit": unit}]
    ability = {"name": "read_inputs", "effect": effect, "parameters": {"channels": channels}}
    result = {"properties": {member: {"type": "number"}}}
    tool = {**LOOK, "capability": "read_inputs", "effect": effect, "output_schema": result}
    given = Artifacts(identify={"devices": [{"id": "arm", "capabilities": [ability]}]})
    assert [item.code for item in channel_unit({"tools": [tool]}, given)] == expected
