"""In sync or not, and what the process that serves the endpoint reports of itself. (Heavy.)

How the deployment is is no matter of this module: that verdict is one for all (`octoform.daemon.status`).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.diagnostics import Diagnostic
from octoform.endpoint.access import tokens
from octoform.endpoint.access.tunnel import no_tunnel, tunnel_now
from octoform.endpoint.client.terminal import list_tools
from octoform.endpoint.dial import halted
from octoform.endpoint.drift import observe
from octoform.endpoint.expected_tools import hidden, promised
from octoform.endpoint.process import record
from octoform.endpoint.process.estop import LATCH
from octoform.endpoint.process.record import Running, running, running_beside
from octoform.engine.plan import memo
from octoform.host import SYSROOT_VARIABLE
from octoform.plan.model import Plan
from octoform.records import dataclass, field, replace
from octoform.state.layout import Layout

UNMATCHED = "PROFILE-UNMATCHED"
NOT_RUNNING = "the endpoint is not running"


@dataclass(frozen=True, slots=True)
class Process:
    """The process that serves the endpoint now, if any.

    ``reported`` is the process's own answer, whose members grow with the endpoint: ``clients``, ``stuck``, ``estop``,
    ``tunnel``. None when nothing runs, or when what runs did not answer. ``estop`` is what engaged the emergency stop,
    which outlives the process; ``tokens`` how many open the endpoint over the network.
    """

    running: Running | None = None
    reported: Mapping[str, Any] | None = None
    estop: Mapping[str, Any] | None = None
    tokens: int = 0


@dataclass(frozen=True, slots=True)
class Status:
    """In sync or not, and what was seen of the endpoint: ``reasons`` are what is not as apply left it.

    ``recorded`` is the folder of a recorded host. ``others`` are hosts of the same folder whose endpoints run, and
    which the manifest no longer names. ``warnings`` are of chosen profiles that match no device.
    """

    host: str
    sync: bool | None
    reasons: tuple[str, ...] = ()
    plan: Plan | None = None
    tools: tuple[str, ...] = ()
    process: Process = field(default_factory=Process)
    diagnostics: tuple[Diagnostic, ...] = ()
    others: tuple[str, ...] = ()
    recorded: str = ""
    warnings: tuple[Diagnostic, ...] = ()


def status(project: Path, environ: Mapping[str, str]) -> Status:
    """Compare with the manifest, and ask the endpoint; starts nothing."""
    return replace(_status(project, environ), recorded=environ.get(SYSROOT_VARIABLE) or "")


def _status(project: Path, environ: Mapping[str, str]) -> Status:
    remembered = memo.recall(project, environ)
    if remembered is not None:
        plan, result = remembered.plan, remembered.diagnostics
    else:
        from octoform.engine.plan.plan import Request, prepare  # heavy, and only what has changed pays for it

        outlook, found = prepare(Request(project, environ))
        if outlook is None:
            return Status("", None, diagnostics=tuple(found))
        plan, result = outlook.plan, tuple(found)
    warnings = tuple(item for item in result if item.code == UNMATCHED)
    return replace(_compared(Layout(project, plan.host), plan), warnings=warnings)


def _compared(layout: Layout, plan: Plan) -> Status:
    facts = observe(layout)
    others = running_beside(layout)
    if not facts.present:
        return Status(plan.host, plan.empty, ("there is no endpoint yet",), plan, others=others)
    process = _process(layout)
    if process.running is None:
        reasons = (NOT_RUNNING, *(reason for reason in facts.reasons if reason != NOT_RUNNING))
        return Status(plan.host, plan.empty, reasons, plan, process=process, others=others)
    listed, problems = list_tools(layout, start=False)
    names = tuple(str(tool["name"]) for tool in listed)
    unread = [_describe(item) for item in tokens.listed(layout)[1]]
    reasons = (*facts.reasons, *_problem_texts(process, problems), *_tunnel(layout, process), *unread)
    if not problems and set(names) != set(promised(layout)) - hidden(layout):
        reasons = (*reasons, "the endpoint's tools are not those of INTERFACE")
    return Status(plan.host, plan.empty, reasons, plan, names, process, problems, others)


def _process(layout: Layout) -> Process:
    found = running(layout)
    result = record.ask(layout, {"op": "status"}) if found and halted(layout) is None else None
    count = sum(1 for token in tokens.listed(layout)[0] if not token.ended)
    return Process(found, result, _engaged_estop(layout), count)


def _engaged_estop(layout: Layout) -> Mapping[str, Any] | None:
    """The record of the engaged emergency stop; any file in the latch's place engages it, readable or not."""
    try:
        words = files.read_json(layout.run / LATCH, any_text=True)
        return {name: str(words[name]) for name in ("by", "reason", "since")}
    except FileNotFoundError:
        return None
    except (OSError, ValueError, LookupError, TypeError):
        return {"by": "unknown", "reason": "its file cannot be read", "since": ""}


def _problem_texts(process: Process, problems: Sequence[Diagnostic]) -> tuple[str, ...]:
    reasons = [_describe(item) for item in problems]
    if process.reported is None or "error" in process.reported:
        reasons.append("the endpoint's process does not answer octoform's own questions")
    return tuple(reasons)


def _tunnel(layout: Layout, process: Process) -> list[str]:
    """Problems of an endpoint with internet scope that cannot be reached; a silent process is reported already."""
    if process.reported is None or "error" in process.reported or (problem := no_tunnel(tunnel_now(layout))) is None:
        return []
    return [problem.summary]  # the process's report on its tunnel has the reason


def _describe(item: Diagnostic) -> str:
    return f"{item.summary}: {item.detail.splitlines()[0]}" if item.detail else item.summary
