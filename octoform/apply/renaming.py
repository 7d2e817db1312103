"""What became of the tools when INTERFACE was made again: a new name for the same is told as such, not as a loss."""

from collections.abc import Iterable, Mapping
from typing import Any

from octoform.apply.context import Context
from octoform.contracts.checking import has_shape
from octoform.contracts.parsing import parse
from octoform.plan.model import Action
from octoform.plan.tools import Tool, changes
from octoform.state.files import read_regular

STAGE = "interface"
MOST = 3


def renamed(context: Context, stage: str, value: Any) -> str:
    """``, take_picture was capture_image``: the end of a line on an INTERFACE that takes the accepted one's place."""
    if stage != STAGE:
        return ""
    data, _ = read_regular(context.layout.output(STAGE))
    before, _ = parse(STAGE, data, STAGE) if data is not None else (None, [])
    if not isinstance(before, Mapping) or not has_shape(STAGE, before, context.schemas):
        return ""
    found = [item for item in changes(_tools(before), _tools(value)) if item.action is Action.UPDATE]
    told = [f", {item.name} was {item.text.removeprefix('renamed from ')}" for item in found]
    more = f" and {len(told) - MOST} more renamed" if len(told) > MOST else ""
    return "".join(told[:MOST]) + more


def _tools(interface: Mapping[str, Any]) -> Iterable[Tool]:
    return [Tool(tool["name"], frozenset(tool["devices"]), tool["effect"]) for tool in interface["tools"]]
