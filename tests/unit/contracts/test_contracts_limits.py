"""Which limits of a profile INTERFACE has to carry: the ranges, of the tools that they speak of, and nothing else."""

from typing import Any

import pytest
from unit.contracts.contract_samples import PROFILES, SCHEMAS, artifacts, good

from octoform.contracts.contract_check import check
from octoform.contracts.model import ProfileFacts


def codes(*limits: dict[str, Any], own: list[dict[str, Any]] | None = None) -> list[str]:
    """The diagnostics of the contract when the lamp's profile has these limits and its tool ``own`` ones."""
    ((name, facts),) = PROFILES.items()
    value = good("interface")
    del value["tools"][3]["limits"]
    if own is not None:
        value["tools"][3]["limits"] = own
    known = artifacts(profiles={name: ProfileFacts(name, facts.holds, limits)})
    return [item.code for item in check("interface", value, known, SCHEMAS)]


@pytest.mark.parametrize(
    "limit",
    [
        {"parameter": "level", "step": 5},
        {"parameter": "level", "cumulative": 500, "unit": "percent"},
        {"tool": "set_lamp_level", "rate": "10/1m"},
        {"tool": "set_*", "cooldown": "2s", "quiet_hours": "22:00-07:00"},
        {"tool": "set_lamp_level", "parameter": "speed", "step": 5},
        {"tool": "read_*", "parameter": "level", "maximum": 1},
        {"tool": "set_*", "parameter": "speed", "maximum": 1},
        {"parameter": "speed", "maximum": 1},
    ],
)
def test_what_is_no_range_of_the_tool_is_not_asked_for(limit: dict[str, Any]) -> None:
    assert codes(limit) == []


@pytest.mark.parametrize("tool", [None, "set_lamp_level", "set_*", "*_level", "set_lamp_leve?"])
def test_a_range_is_asked_for_by_name_and_by_glob(tool: str | None) -> None:
    limit = {"parameter": "level", "maximum": 80, "step": 5} | ({"tool": tool} if tool else {})
    assert codes(limit) == ["INTERFACE-LIMIT-MISSING"]
    assert codes(limit, own=[{"parameter": "level", "maximum": 81}]) == ["INTERFACE-LIMIT-WIDER"]
    assert codes(limit, own=[{"parameter": "level", "maximum": 80}]) == []


def test_a_tool_that_is_named_in_full_must_have_the_parameter() -> None:
    assert codes({"tool": "set_lamp_level", "parameter": "speed", "maximum": 1}) == ["INTERFACE-LIMIT-MISSING"]
