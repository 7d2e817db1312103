"""One attempt below containment, as every harness does it: environment, log, and the run told back as an Outcome.

A harness only says which program to run and how the prompt reaches it; everything that must hold for any agent
stands here once.
"""

import os
import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from octoform.harness import environment, usage
from octoform.harness.containment import Ended, Limits, Program, run
from octoform.harness.port import ExitReason, Outcome, ProgressSink, Task

REASONS = {"wall": ExitReason.TIMEOUT, "not_started": ExitReason.NOT_INSTALLED, "ended": ExitReason.FINISHED}


@dataclass(frozen=True, slots=True)
class Invocation:
    """The program and its arguments, the file on its standard input (None: empty), the variables that it may see."""

    argv: tuple[str, ...]
    stdin: Path | None = None
    named: tuple[str, ...] = ()


def run_contained(task: Task, invocation: Invocation, progress: ProgressSink) -> Outcome:
    """Run the invocation for the task; OSError only when octoform cannot write the attempt's own files."""
    variables = environment.minimal(task.workdir, task.environment, invocation.named)
    variables |= {
        environment.TASK: str(task.document),
        environment.PROMPT: str(task.prompt),
        environment.OUTPUT: str(task.output),
    }
    name = invocation.argv[0]
    program = shutil.which(name, path=variables["PATH"])
    if program is None:
        return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, not_installed(name))
    ended = run(
        Program(
            argv=(program, *invocation.argv[1:]),
            workdir=task.workdir,
            environment=variables,
            log=task.log,
            stdin=invocation.stdin,
            secrets=environment.secrets(task.environment, (*invocation.named, *task.secrets)),
        ),
        Limits(wall_seconds=task.wall_seconds),
        progress,
    )
    # Scratch files are no part of an attempt's record and may be large; what cannot be removed stays.
    shutil.rmtree(task.workdir / "tmp", ignore_errors=True)
    return outcome(ended, task, invocation)


def not_installed(name: str) -> str:
    """The one line for a program that is not there."""
    return f"the agent program {name!r} is not installed, or not executable, or not on the PATH"


def outcome(ended: Ended, task: Task, invocation: Invocation) -> Outcome:
    """The end of the tree in the words of the port."""
    reason = REASONS.get(ended.reason, ExitReason.CRASHED)
    if reason is ExitReason.FINISHED and ended.status != 0:
        reason = ExitReason.CRASHED
    return Outcome(
        reason=reason,
        exit_status=None if ended.reason == "not_started" else ended.status,
        seconds=ended.seconds,
        detail=_detail(ended, task, invocation),
        usage=usage.read(task.workdir),
        survivors_killed=ended.survivors,
    )


def _detail(ended: Ended, task: Task, invocation: Invocation) -> str:
    said = [_reason(ended, task, invocation.argv[0])]
    if ended.survivors:
        said.append(f"{ended.survivors} process(es) that it had left running were ended")
    if ended.remaining:
        said.append(f"{ended.remaining} process(es) could not be ended")
    if ended.containment != "subreaper":
        said.append("this system can end only the agent's own process group")
    if ended.log_dropped:
        said.append(f"its log was cut after {ended.log_bytes} bytes")
    unset = _unset(task, invocation.named) if ended.status != 0 else []
    if unset:
        said.append(f"not set in the environment: {', '.join(unset)}")
    return "; ".join(text for text in said if text)


def _reason(ended: Ended, task: Task, name: str) -> str:
    if ended.reason == "wall":
        return f"stopped after its limit of {task.wall_seconds:g} s"
    if ended.reason == "not_started":
        return f"{not_installed(name)} ({os.strerror(ended.errno)})"
    if ended.reason == "lost":
        return "its supervisor was killed"
    if ended.reason != "ended":
        return "it was stopped from outside"
    if ended.status is not None and ended.status < 0:
        return f"ended by signal {-ended.status}"
    return f"exit status {ended.status}" if ended.status else ""


def _unset(task: Task, named: Sequence[str]) -> list[str]:
    return [name for name in named if not task.environment.get(name)]
