"""The harness port: how any agent is given one task and how its run is told back.

An agent gets a folder, a prompt and the name of one file to write. What it says about itself (exit status, closing
words) is recorded and never believed: only the gate decides whether the output counts.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Protocol


class ExitReason(StrEnum):
    """How a run ended, as the orchestrator saw it.

    Finished means exit status 0; crashed is another exit status, a signal, or a run that was stopped from outside.
    """

    FINISHED = "finished"
    TIMEOUT = "timeout"
    CRASHED = "crashed"
    NOT_INSTALLED = "not_installed"


@dataclass(frozen=True, slots=True)
class Usage:
    """What a run cost, as far as the agent told: tokens as counts, cost in US dollars; None is unknown."""

    input_tokens: int | None = None
    cached_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None


@dataclass(frozen=True, slots=True)
class Task:
    """One attempt at one stage.

    ``workdir`` is the attempt's own folder and the agent's working directory; ``output`` lies in it and does not
    exist yet. ``document`` is the machine-readable task that stands in ``workdir/task.json``. ``environment`` is what
    the caller has: the agent gets PATH, the OCTOFORM_ settings and the variables that its harness names out of it.
    """

    stage: str
    attempt: int
    workdir: Path
    prompt: Path
    output: Path
    log: Path
    document: Path
    model: str | None
    environment: Mapping[str, str]
    wall_seconds: float
    secrets: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the run ended; ``exit_status`` is negative for a signal, None when nothing was started."""

    reason: ExitReason
    exit_status: int | None
    seconds: float
    detail: str = ""
    usage: Usage = field(default_factory=Usage)
    survivors_killed: int = 0


ProgressSink = Callable[[str, float], None]


class Harness(Protocol):
    """Runs an agent on one task, blocking, within ``task.wall_seconds``; leaves no process behind."""

    @property
    def name(self) -> str:
        """The name that stands in the manifest."""
        ...

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """Run it; never raises for what the agent does, OSError when the attempt's own files cannot be written."""
        ...
