"""One attempt below containment, as every harness does it: environment, log, and the run reported as an Outcome.

A harness only states which program to run, how the prompt reaches it and how its output is read; everything that must
hold for any agent is here once.
"""

import json
import os
import shutil
import signal
from collections.abc import Mapping, Sequence
from pathlib import Path

from octoform.base.files import parse, read_plain
from octoform.diagnostics import Diagnostic
from octoform.harness.containment import agent_environment, sandbox
from octoform.harness.containment.contained_run import FILE_BYTES, Ended, Limits, Program, run
from octoform.harness.event_parser import Dialect
from octoform.harness.port import ExitReason, Outcome, ProgressSink, Task, Usage
from octoform.harness.watcher import Watcher
from octoform.manifest.model import Sandbox
from octoform.records import dataclass, field, replace

# The cost that an agent reports of its run, read from a file that it may have written.
#
# The numbers come from an untrusted program, so each is checked for itself: one that is no sensible number is unknown,
# never zero.

FILE_NAME = "usage.json"
SIZE_LIMIT = 64 << 10


def read_usage(workdir: Path) -> Usage:
    """``usage.json`` of the attempt: input_tokens, cached_tokens, output_tokens (counts), cost_usd (dollars)."""
    data = read_plain(workdir / FILE_NAME, SIZE_LIMIT)
    try:
        value = parse(data or b"")
    except ValueError:
        return Usage()
    if not isinstance(value, dict):
        return Usage()
    return Usage(
        input_tokens=_count(value.get("input_tokens")),
        cached_tokens=_count(value.get("cached_tokens")),
        output_tokens=_count(value.get("output_tokens")),
        cost_usd=_money(value.get("cost_usd")),
    )


def _count(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53 else None


def _money(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if 0 <= value < 1e9 else None


REASONS = {"wall": ExitReason.TIMEOUT, "not_started": ExitReason.NOT_INSTALLED, "ended": ExitReason.FINISHED}


@dataclass(frozen=True, slots=True)
class Invocation:
    """The program and its arguments, the file on its standard input (None: empty), the variables that it may see.

    ``settings`` are variables that the harness itself sets; ``path`` are folders to put before PATH. ``dialect`` reads
    its output; without one each line is its output. ``program`` names it with its version, for the record.
    ``sandbox`` confines it where that can be had; None: it may write wherever the user may. ``closes``: its output
    always ends with a word on how the run went, so that a run without one was cut short, whatever its exit status.
    ``piped`` are variables that it gets as a JSON object on its standard input instead, since any process of the user
    can read its environment.
    """

    argv: tuple[str, ...]
    stdin: Path | None = None
    named: tuple[str, ...] = ()
    settings: Mapping[str, str] = field(default_factory=dict)
    path: tuple[str, ...] = ()
    dialect: Dialect | None = None
    program: str | None = None
    sandbox: Sandbox | None = None
    closes: bool = False
    piped: tuple[str, ...] = ()


def run_contained(task: Task, invocation: Invocation, progress: ProgressSink) -> Outcome:
    """Run the invocation for the task; OSError only when octoform cannot write the attempt's own files.

    However it ends, an interrupt by the person included, the agent's private folders are removed.
    """
    try:
        return _contained(task, invocation, progress)
    finally:
        if invocation.sandbox is not None:
            sandbox.released(task.workdir)
        agent_environment.remove_private(task.workdir)


def _contained(task: Task, invocation: Invocation, progress: ProgressSink) -> Outcome:
    variables = _environment(task, invocation)
    name = invocation.argv[0]
    program = shutil.which(name, path=variables["PATH"])
    if program is None:
        return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, not_installed(name))
    argv = (program, *invocation.argv[1:])
    confined = _confined(argv, task, invocation, variables)
    if isinstance(confined, Diagnostic) and invocation.sandbox is not None and invocation.sandbox.required:
        return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, f"{confined.summary} ({confined.hint})")
    secrets = agent_environment.secrets(task.environment, (*invocation.named, *invocation.piped, *task.secrets))
    watcher = Watcher(invocation.dialect, task.limits, progress, task.price).recording(task.transcript, secrets)
    ended = run(
        Program(
            argv=argv if isinstance(confined, Diagnostic) else confined,
            workdir=task.workdir,
            environment=variables,
            log=task.log,
            stdin=invocation.stdin,
            secrets=secrets,
            piped=_piped(task, invocation),
        ),
        Limits(wall_seconds=task.limits.wall_seconds),
        watcher,
    )
    found = outcome(ended, task, invocation, watcher)
    return _unconfined(found, confined.summary) if isinstance(confined, Diagnostic) else found


def _unconfined(outcome: Outcome, why: str) -> Outcome:
    """The outcome of an agent that no sandbox held, with what follows from that."""
    lines = [outcome.detail, f"it ran without a sandbox: {why}"]
    return replace(outcome, unconfined=why, detail="; ".join(text for text in lines if text))


def _piped(task: Task, invocation: Invocation) -> bytes:
    given = {name: task.environment[name] for name in invocation.piped if name in task.environment}
    return json.dumps(given).encode() if invocation.piped else b""


def _environment(task: Task, invocation: Invocation) -> dict[str, str]:
    variables = agent_environment.minimal(task.workdir, task.environment, invocation.named)
    variables |= invocation.settings
    variables |= {
        agent_environment.TASK: str(task.document),
        agent_environment.PROMPT: str(task.prompt),
        agent_environment.OUTPUT: str(task.output),
        "PATH": os.pathsep.join((*invocation.path, variables["PATH"])),
    }
    return variables


def _confined(
    argv: tuple[str, ...], task: Task, invocation: Invocation, variables: Mapping[str, str]
) -> tuple[str, ...] | Diagnostic:
    if invocation.sandbox is None:
        return argv
    around = sandbox.Confinement(task.workdir, task.document, variables, task.environment)
    return sandbox.wrap(argv, invocation.sandbox, around)


def not_installed(name: str) -> str:
    """The one line for a program that is not there."""
    return f"the agent program {name!r} is not installed, or not executable, or not on the PATH"


def outcome(ended: Ended, task: Task, invocation: Invocation, watcher: Watcher) -> Outcome:
    """The end of the tree in the words of the port."""
    return Outcome(
        reason=_reason(ended, invocation, watcher),
        exit_status=None if ended.reason == "not_started" else ended.status,
        seconds=ended.seconds,
        detail=_detail(ended, task, invocation, watcher),
        usage=_usage(task, watcher),
        survivors_killed=ended.survivors,
        turns=watcher.turns,
        program=invocation.program,
    )


def _reason(ended: Ended, invocation: Invocation, watcher: Watcher) -> ExitReason:
    """The event stream is above the exit status: several programs leave with 0 after a failure."""
    if ended.reason == "ordered" and watcher.reason is not None:
        return watcher.reason
    if ended.reason != "ended":
        return REASONS.get(ended.reason, ExitReason.CRASHED)
    if watcher.problem is not None:
        return watcher.problem.reason
    if watcher.closed is not None and watcher.closed.ok:
        return ExitReason.FINISHED
    return ExitReason.FINISHED if ended.status == 0 and not _silent(invocation, watcher) else ExitReason.CRASHED


def _silent(invocation: Invocation, watcher: Watcher) -> bool:
    """No event reported how the run went, although this program always sends one."""
    return invocation.closes and watcher.closed is None and watcher.problem is None


def _usage(task: Task, watcher: Watcher) -> Usage:
    """The usage by the stream; else by the agent's usage file."""
    used = watcher.usage
    known = (used.input_tokens, used.output_tokens, used.cost_usd)
    return used if any(value is not None for value in known) else read_usage(task.workdir)


def _detail(ended: Ended, task: Task, invocation: Invocation, watcher: Watcher) -> str:
    lines = [_ending(ended, task, invocation.argv[0], watcher)]
    if ended.reason == "ended" and ended.status == 0 and _silent(invocation, watcher):
        lines.append("it ended without a word on how its run went")
    lines.append(_words(ended, watcher))
    if ended.survivors and ended.reason == "ended":
        # Of a tree that was ended as a whole nothing was left behind: these are the program's own tools.
        lines.append(f"{ended.survivors} process(es) that it had left running were ended")
    if ended.remaining:
        lines.append(f"{ended.remaining} process(es) could not be ended")
    if ended.reason in ("lost", "halted") and invocation.sandbox is None:
        lines.append("without a sandbox it can hide a process from octoform, which may run on")
    if ended.containment != "subreaper":
        lines.append("this system can end only the agent's own process group")
    if ended.log_dropped:
        lines.append(f"its log was cut after {ended.log_bytes} bytes")
    unset = _unset(task, (*invocation.named, *invocation.piped)) if ended.status != 0 else []
    if unset:
        lines.append(f"not set in the environment: {', '.join(unset)}")
    return "; ".join(text for text in lines if text)


def _words(ended: Ended, watcher: Watcher) -> str:
    """The program's own closing message; where there is none, its last error."""
    closed = watcher.closed
    lines = [watcher.problem.text] if watcher.problem is not None else []
    lines += [closed.text] if closed is not None and not closed.ok and closed.text else []
    if not lines and closed is None and ended.reason == "ended" and ended.status and watcher.last_words:
        lines.append(f"its last output: {watcher.last_words}")
    return "; ".join(lines)


def _ending(ended: Ended, task: Task, name: str, watcher: Watcher) -> str:
    limits = task.limits
    if ended.reason == "ordered":
        return {
            ExitReason.FINISHED: "it reported that it was done, did not exit, and was ended",
            ExitReason.IDLE: f"stopped after {limits.idle_seconds or 0:g} s without a sign of progress",
            ExitReason.TURN_LIMIT: f"stopped after {watcher.turns} replies of the model, {limits.turns} are allowed",
            ExitReason.BUDGET: f"stopped when its cost passed {limits.usd or 0:.2f} US dollars",
        }.get(watcher.reason or ExitReason.CRASHED, "stopped, since trying again would not have helped")
    if ended.reason == "wall":
        return f"stopped after its limit of {limits.wall_seconds:g} s"
    if ended.reason == "not_started":
        return f"{not_installed(name)} ({os.strerror(ended.errno)})"
    if ended.reason in ("lost", "halted"):
        return f"its supervisor was {'killed' if ended.reason == 'lost' else 'stopped by a signal'}, so it was ended"
    if ended.reason != "ended":
        return "it was stopped from outside"
    if ended.status == -signal.SIGXFSZ:
        return f"ended by signal {-ended.status}: a file of more than {FILE_BYTES >> 20} MiB was written"
    if ended.status is not None and ended.status < 0:
        return f"ended by signal {-ended.status}"
    return f"exit status {ended.status}" if ended.status else ""


def _unset(task: Task, named: Sequence[str]) -> list[str]:
    return [name for name in named if not task.environment.get(name)]
