"""The unit that a result is judged by: a member's own name before its description, and no other number's unit."""

import pytest

from octoform.endpoint.client.check_verdict import out_of_bounds

_JUDGED = {
    "level_percent": (1500, "the level"),
    "temperature": (53125, "temperature in degrees Celsius"),
    "load": (1500, "Load, percent"),
    "mount_percent": (1500, "steps at 100 percent"),
}
_NOT_JUDGED = {
    "max_steps": (1500, "steps at 100 percent"),
    "steps": (1500, "percent of full brightness in steps of the display"),
    "scale": (53125, "counts per degree Celsius"),
    "brightest": (1500, "what the display has at 100 percent"),
    "either": (1500, "percent or kelvin"),
}


@pytest.mark.parametrize("name", _JUDGED)
def test_a_member_with_a_unit_is_held_to_it(name: str) -> None:
    value, description = _JUDGED[name]
    assert len(out_of_bounds({name: value}, {"properties": {name: {"description": description}}})) == 1


@pytest.mark.parametrize("name", _NOT_JUDGED)
def test_the_unit_of_another_number_is_not_the_members(name: str) -> None:
    value, description = _NOT_JUDGED[name]
    assert out_of_bounds({name: value}, {"properties": {name: {"description": description}}}) == []
