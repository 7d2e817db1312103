"""A transcript as events again: what an agent did in an attempt that is over, for a person and for a replay.

The file lies in a folder that the agent could write to, so it is data: a line that is no event is passed over, and a
value of the wrong kind is as good as none.
"""

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from octoform.base.files import read_plain
from octoform.harness.event_parser import count, field, json_object
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.harness.watcher import KINDS, TRANSCRIPT_BYTES, added
from octoform.records import dataclass, replace

REASONS = {reason.value: reason for reason in ExitReason}


@dataclass(frozen=True, slots=True)
class Moment:
    """One event, and how many seconds after the start of the run it came."""

    at: float
    event: AgentEvent


def read(path: Path) -> list[Moment]:
    """The events of a transcript in their order; none when there is no plain file."""
    return decode(read_plain(path, TRANSCRIPT_BYTES) or b"")


def decode(data: bytes) -> list[Moment]:
    """The events that the lines hold; what is no event is omitted."""
    found = []
    for line in data.split(b"\n"):
        value = json_object(line)
        event = _event(value) if value is not None else None
        if event is not None:
            found.append(Moment(_number(field(value, "at")) or 0.0, event))
    return found


def encode(moments: Iterable[Moment]) -> bytes:
    """The lines of a transcript."""
    return b"".join(_line(moment) for moment in moments)


def used(moments: Iterable[Moment]) -> tuple[int | None, Usage]:
    """Replies of the model so far (None where none is reported) and what they used; as the watcher counts, unpriced."""
    turns, summed, totals = None, Usage(), None
    for moment in moments:
        match moment.event:
            case Turn(usage):
                turns, summed = (turns or 0) + 1, added(summed, usage)
            case Totals(usage):
                totals = usage
    return turns, totals or summed


def text_of(event: AgentEvent) -> str:
    """The words of an event; empty where it has none."""
    return event.text if isinstance(event, Output | ToolCalled | ModelProblem | Closed) else ""


def with_text(event: AgentEvent, text: str) -> AgentEvent:
    """The event with another text, where it has one."""
    return replace(event, text=text) if isinstance(event, Output | ToolCalled | ModelProblem | Closed) else event


def _line(moment: Moment) -> bytes:
    fields = {name: value for name, value in asdict(moment.event).items() if value is not None}
    value = {"at": moment.at, "event": KINDS[type(moment.event)], **fields}
    return json.dumps(value, ensure_ascii=False).encode("utf-8", "replace") + b"\n"


def _event(value: dict[str, Any]) -> AgentEvent | None:
    text = _text(value.get("text"))
    match value.get("event"):
        case "said":
            return Output(text)
        case "tool_called":
            return ToolCalled(_text(value.get("tool")), text)
        case "tool_returned":
            return ToolReturned(value.get("failed") is True)
        case "turn":
            return Turn(_usage(value))
        case "totals":
            return Totals(_usage(value))
        case "trouble":
            reason = REASONS.get(_text(value.get("reason")), ExitReason.CRASHED)
            return ModelProblem(reason, text, value.get("final") is True)
        case "closed":
            return Closed(value.get("ok") is True, text)
    return None


def _usage(value: dict[str, Any]) -> Usage:
    return Usage(
        input_tokens=count(value, "usage", "input_tokens"),
        cached_tokens=count(value, "usage", "cached_tokens"),
        output_tokens=count(value, "usage", "output_tokens"),
        cost_usd=_number(field(value, "usage", "cost_usd")),
        cost_source=_text(field(value, "usage", "cost_source")) or None,
    )


def _text(value: object) -> str:
    return value if isinstance(value, str) else ""


def _number(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if 0 <= value < 1e9 else None
