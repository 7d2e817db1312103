"""The words in which a caller hears what became of a call that did not simply return."""

import json
from typing import Any

from fastmcp.tools.base import ToolResult

from .calls import Call, Refused
from .guarding import Stopped
from .latch import Estop

REFUSED = "octoform/refused"
DRY = "octoform/dry_run"
UNAUDITED = "octoform/audit"
ARGUMENTS_CHARS = 2000


def refusal(refused: Refused) -> ToolResult:
    """An error with the sentence, and the code for programs."""
    return ToolResult(content=str(refused), meta={REFUSED: refused.code}, is_error=True)


def error(text: str) -> ToolResult:
    return ToolResult(content=text, is_error=True)


def estop(stop: Estop) -> Refused:
    """Nothing that moves is called while the emergency stop is latched."""
    return Refused(
        "estop",
        f"emergency stop: engaged by {stop.by} at {stop.since or 'an unknown time'} "
        f"({stop.reason or 'no reason given'}). "
        "Nothing that moves is called until a person runs octoform estop -clear",
    )


def overtaken() -> Refused:
    """An emergency stop came, and was cleared perhaps, while the call waited."""
    return Refused(
        "estop",
        "emergency stop: it came after this call did, so the call is not made, no matter who approved it before. "
        "Call the tool again if it still has to be done",
    )


def absent(names: list[str]) -> Refused:
    return Refused(
        "absent", f"device absent: {', '.join(names)}. Nothing was done; the tool works again once it is there"
    )


def stopped(call: Call, problem: Stopped) -> str:
    """What a client hears of a call that was stopped while it ran."""
    policy = call.entry.policy
    if call.work is not None and not call.work.begun:
        why = "the endpoint ends" if problem.cause == "shutdown" else "an emergency stop came"
        return f"{call.entry.name} was not begun, because {why}"
    if problem.cause == "estop":
        text = f"emergency stop: {call.entry.name} was interrupted while it ran"
    elif problem.cause == "shutdown":
        text = f"{call.entry.name} was interrupted because the endpoint ends"
    elif problem.cause == "blocked":
        text = f"{call.entry.name} blocked every other call and was interrupted"
    else:
        text = f"{call.entry.name} did not return within its {policy.timeout:g} s and was stopped"
    if problem.ended:
        return f"{text}. What its device did until then is not undone"
    held = f" of {', '.join(policy.buses)}" if policy.buses else ""
    return f"{text}, but its code has not ended yet; other calls{held} wait until it has"


def dry_run(call: Call) -> ToolResult:
    """What would be done. As data where the tool's output schema has room for that, else as an error without data:
    a client refuses a result without the data that the schema promises."""
    policy = call.entry.policy
    shown = json.dumps(dict(call.arguments), ensure_ascii=True, default=repr)
    if len(shown) > ARGUMENTS_CHARS:
        shown = f"{shown[:ARGUMENTS_CHARS]}... ({len(shown)} characters)"
    first = " after a person confirmed it" if call.confirms else ""
    where = f" on {', '.join(policy.buses)}" if policy.buses else ""
    text = f"dry run: nothing was done. {call.entry.name} would be called{where} with {shown}{first} ({policy.source})"
    data: dict[str, Any] = {"dry_run": True, "tool": call.entry.name, "arguments": shown}
    meta = {DRY: True}
    if call.entry.fits is None:
        return ToolResult(content=text, meta=meta)
    if call.entry.fits(data) is None:
        return ToolResult(content=text, structured_content=data, meta=meta)
    return ToolResult(content=text, meta=meta, is_error=True)
