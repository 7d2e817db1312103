"""The emergency stop from outside: by the process that holds the devices, and without it when it does not answer.

It asks for nothing that could be in the way: no manifest, no environment, no lock. Light.
"""

import os
from collections.abc import Mapping
from typing import Any

from octoform.endpoint.process import offline_commands, record
from octoform.endpoint.process.record import running
from octoform.endpoint.published_files import is_copy, of_another
from octoform.records import dataclass
from octoform.state.layout import Layout

LATCH = "estop.json"
ALIVE_SECONDS = 1.0
"""Seconds in which a working process must answer."""
ANSWER_SECONDS = 15.0


@dataclass(frozen=True, slots=True)
class StopAction:
    """The result of writing a device's stop bytes; ``ms`` is the duration."""

    device: str
    ok: bool
    detail: str
    ms: float


@dataclass(frozen=True, slots=True)
class Estop:
    """The result of a stop. ``ok``: all was done. ``by``, ``reason``, ``since``: of the latch now, or before it
    was cleared; None when it was open. ``direct``: no process answered, so octoform did it itself. ``lasting``: it is
    engaged on the disk; where it is engaged and this is false, it holds while the process runs, and no longer."""

    host: str
    ok: bool
    latched: bool
    by: str | None
    reason: str | None
    since: str | None
    stopped: tuple[StopAction, ...]
    problems: tuple[str, ...]
    direct: bool
    lasting: bool


def stop(layout: Layout, by: str, reason: str) -> Estop:
    """Latch the host's endpoint and run its stop actions."""
    return _done(layout, "estop", "stop", {"by": by, "reason": reason})


def clear(layout: Layout, by: str) -> Estop:
    """Let actuators be called again."""
    return _done(layout, "clear_estop", "clear", {"by": by})


def _done(layout: Layout, op: str, verb: str, asked: Mapping[str, Any]) -> Estop:
    answer, problems = None, []
    if record.ask(layout, {"op": "status"}, ALIVE_SECONDS) is not None:
        answer = record.ask(layout, {"op": op, **asked}, ANSWER_SECONDS)
    direct = answer is None or "latched" not in answer
    original = of_another(layout) if direct and is_copy(layout) else None
    if original is not None:
        # The devices are those of the original's endpoint, which is not asked from here.
        return _result(layout, {"ok": False}, [f"{original.summary}; {original.hint}"], direct)
    if answer is None or direct:
        answer = offline_commands.ask(layout, verb, asked)
        process = running(layout)
        if process is not None and verb == "stop":
            problems.append(
                f"the endpoint runs (pid {process.pid}) but did not answer, so what it is doing now was not "
                "interrupted; octoform stop ends it"
            )
    return _result(layout, answer, problems, direct)


def _result(layout: Layout, answer: Mapping[str, Any], problems: list[str], direct: bool) -> Estop:
    lasting = is_engaged(layout)
    # What a program of octoform's own held in its memory has ended with that program.
    latched = bool(answer.get("latched")) and (lasting or not direct)
    estop = (answer.get("estop") if latched or answer.get("ok") else None) or {}
    return Estop(
        host=layout.host,
        ok=bool(answer.get("ok")) and not problems,
        latched=latched,
        by=estop.get("by"),
        reason=estop.get("reason"),
        since=estop.get("since"),
        stopped=tuple(
            StopAction(str(item["device"]), bool(item["ok"]), str(item["detail"]), float(item["ms"]))
            for item in answer.get("stopped", ())
        ),
        problems=(*(str(text) for text in answer.get("problems", ())), *problems),
        direct=direct,
        lasting=lasting,
    )


def is_engaged(layout: Layout) -> bool:
    """Whether the latch is on the disk; a place that cannot be looked at counts as engaged, as for the gate."""
    try:
        os.lstat(layout.run / LATCH)
    except FileNotFoundError:
        return False
    except OSError:
        return True
    return True
