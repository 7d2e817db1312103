"""The ledger's settings of the deployment: the tools served now, and the bounds of profiles as plain values."""

import json
from pathlib import Path
from typing import Any

import pytest

from octoform.claims.settings import Bound, ServedTools, ToolFacts, bounds_of
from octoform.endpoint.published_files import POLICY
from octoform.state.layout import Layout

MOVE = {
    "name": "arm_move",
    "effect": "actuate",
    "devices": ["usb-1"],
    "units": {"parameter": "joint"},
    "input_schema": {"properties": {"joint": {"enum": ["elbow", "wrist"]}, "position": {"type": "integer"}}},
}
STOP = {"name": "arm_stop", "effect": "actuate", "devices": ["usb-1"]}


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    made = Layout(tmp_path, "bench")
    for path in (made.endpoint, made.output("interface").parent):
        path.mkdir(parents=True)
    return made


def publish(layout: Layout, *tools: dict[str, Any], of_policy: dict[str, Any]) -> None:
    layout.output("interface").write_text(json.dumps({"tools": tools}))
    tools_of_policy = {name: {"effect": "actuate", **more} for name, more in of_policy.items()}
    (layout.endpoint / POLICY).write_text(json.dumps({"format": 1, "mode": "enforce", "tools": tools_of_policy}))


def test_a_tool_has_the_effect_the_choices_and_the_unit_of_its_artifact(layout: Layout) -> None:
    publish(layout, MOVE, STOP, of_policy={"arm_move": {}, "arm_stop": {"stops": True}})
    assert dict(ServedTools(layout)) == {
        "arm_move": ToolFacts("actuate", False, ("usb-1",), {"joint": ("elbow", "wrist")}, "joint"),
        "arm_stop": ToolFacts("actuate", True, ("usb-1",)),
    }


def test_tools_are_read_again_once_they_were_published_anew(layout: Layout) -> None:
    served = ServedTools(layout)
    assert len(served) == 0
    publish(layout, MOVE, STOP, of_policy={"arm_move": {}})
    assert list(served) == ["arm_move"], "what the policy does not have is not served"
    publish(layout, MOVE, STOP, of_policy={"arm_move": {}, "arm_stop": {}})
    assert list(served) == ["arm_move", "arm_stop"]


@pytest.mark.parametrize("damage", ["{", "[]", '{"format": 1, "tools": []}', '{"format": 1, "tools": {"arm_move": 3}}'])
def test_where_the_policy_cannot_be_read_there_is_no_tool(layout: Layout, damage: str) -> None:
    publish(layout, MOVE, of_policy={"arm_move": {}})
    (layout.endpoint / POLICY).write_text(damage)
    assert dict(ServedTools(layout)) == {}


def test_bounds_come_back_from_plain_values_and_what_is_none_is_left_out() -> None:
    fields = {
        "name": "temperature",
        "trouble_above": 65,
        "settled_below": 60,
        "sources": ["arm_status"],
        "source": "arm",
    }
    wrong = [{**fields, "trouble_above": "65"}, {**fields, "name": 3}, {**fields, "settled_below": float("nan")}, {}]
    assert bounds_of([*wrong, fields]) == (
        Bound("temperature", trouble_above=65, settled_below=60, sources=("arm_status",), source="arm"),
    )
