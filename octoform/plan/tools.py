"""Which tools come, go or are only called something else, between what the endpoint offers and what INTERFACE says.

What a tool is for are its devices and what it does to them; its name is a word. So a tool that goes while one comes
for the same devices with the same effect, each of them the only one, was renamed. Pure.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from octoform.plan.model import Action, Change

KIND = "tool"


@dataclass(frozen=True, slots=True)
class Tool:
    """A tool as far as it counts here."""

    name: str
    devices: frozenset[str]
    effect: str


def changes(before: Iterable[Tool], after: Iterable[Tool]) -> tuple[Change, ...]:
    """Renamed tools first, then what comes, then what goes; nothing of a tool that keeps its name."""
    old, new = {tool.name: tool for tool in before}, {tool.name: tool for tool in after}
    gone = [tool for name, tool in old.items() if name not in new]
    come = [tool for name, tool in new.items() if name not in old]
    renamed = {
        tool.name: same[0] for tool in come if (same := _same(tool, gone)) and len(same) == len(_same(tool, come)) == 1
    }
    left = {tool.name for tool in gone} - {tool.name for tool in renamed.values()}
    return (
        *(Change(KIND, name, Action.UPDATE, f"renamed from {was.name}") for name, was in sorted(renamed.items())),
        *(Change(KIND, tool.name, Action.CREATE) for tool in come if tool.name not in renamed),
        *(Change(KIND, tool.name, Action.DESTROY) for tool in gone if tool.name in left),
    )


def _same(tool: Tool, among: Iterable[Tool]) -> list[Tool]:
    return [other for other in among if (other.devices, other.effect) == (tool.devices, tool.effect)]
