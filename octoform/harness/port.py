"""The harness port: how any agent is given one task and how its run is reported.

An agent gets a folder, a prompt and the name of one file to write. What it reports about itself (exit status, closing
words) is recorded and never believed: only the gate decides whether the output counts.
"""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from octoform.records import dataclass, field


class ExitReason(StrEnum):
    """How a run ended, as the orchestrator saw it.

    Finished: the program ended by itself and nothing was wrong with its run. Timeout, idle, turn limit and budget are
    limits that octoform keeps. Auth, refused, rate limit and unreachable are what the model's side answered when the
    run came to nothing; refused: whatever the key, it takes no such request (an unknown model, an empty account).
    Crashed is another exit status, a signal, or a run that was stopped from outside. Interrupted: octoform itself was
    stopped before the attempt was over; no harness answers that.
    """

    FINISHED = "finished"
    TIMEOUT = "timeout"
    IDLE = "idle"
    TURN_LIMIT = "turn_limit"
    BUDGET = "budget"
    AUTH = "auth"
    REFUSED = "refused"
    RATE_LIMIT = "rate_limit"
    UNREACHABLE = "unreachable"
    CRASHED = "crashed"
    NOT_INSTALLED = "not_installed"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True, slots=True)
class Usage:
    """The usage of a run, as far as it is known: tokens as counts, cost in US dollars; None is unknown.

    ``input_tokens`` are all tokens that went in, the ``cached_tokens`` among them. ``cost_source`` states who priced
    them: ``manifest``, a table (``litellm`` or octoform's own, with its date), or the program that reports its cost.
    """

    input_tokens: int | None = None
    cached_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    cost_source: str | None = None


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Text of at most the asked bytes, to be fenced as data like any log.

    ``condensed``: it is a model's summary; else it is the log's end, and ``reason`` states why it is when a summary was
    wanted. ``usage`` is what the summary cost.
    """

    text: str
    condensed: bool = False
    reason: str = ""
    usage: Usage = field(default_factory=Usage)


@dataclass(frozen=True, slots=True)
class Price:
    """US dollars for a million tokens: fresh input, input read from a cache, output; and whose table it is from."""

    input: float
    cached: float
    output: float
    source: str


@dataclass(frozen=True, slots=True)
class TaskLimits:
    """The limits of one run: seconds in all, seconds without a sign of progress, replies of the model, US dollars.

    None is no limit. Only harnesses whose output shows turns can keep a limit of turns and dollars.
    ``patience_seconds`` is how long a program may go on trying after the model's side has begun to fail.
    """

    wall_seconds: float
    idle_seconds: float | None = None
    turns: int | None = None
    usd: float | None = None
    patience_seconds: float = 30.0


@dataclass(frozen=True, slots=True)
class Task:
    """One attempt at one stage.

    ``workdir`` is the attempt's own folder and the agent's working directory; ``output`` lies in it and does not
    exist yet. ``document`` is the machine-readable task that is in ``workdir/task.json``. ``environment`` is what
    the caller has: the agent gets PATH, the OCTOFORM_ settings and the variables that its harness names out of it.
    ``secrets`` names the variables whose values may reach no file; ``price`` is what the model costs, None unknown.
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
    limits: TaskLimits
    secrets: tuple[str, ...] = ()
    price: Price | None = None

    @property
    def transcript(self) -> Path:
        """The agent's events, one JSON object a line, in the same words for every harness."""
        return self.workdir / "transcript.jsonl"


@dataclass(frozen=True, slots=True)
class Outcome:
    """How the run ended; ``exit_status`` is negative for a signal, None when nothing was started.

    ``turns`` counts replies of the model, None where the harness does not report it. ``program`` is the program that
    ran, with its version where it reported one. ``unconfined`` states why the agent ran without a sandbox that was to
    be had; empty where it was confined or was not to be.
    """

    reason: ExitReason
    exit_status: int | None
    seconds: float
    detail: str = ""
    usage: Usage = field(default_factory=Usage)
    survivors_killed: int = 0
    turns: int | None = None
    program: str | None = None
    unconfined: str = ""


@dataclass(frozen=True, slots=True)
class Output:
    """A line that the agent printed or its model wrote; empty text after ten silent seconds."""

    text: str


@dataclass(frozen=True, slots=True)
class ToolCalled:
    """The agent uses one of its tools; ``text`` is the command, path or query on one line."""

    tool: str
    text: str


@dataclass(frozen=True, slots=True)
class ToolReturned:
    """A tool has ended; ``failed`` as the program sees it."""

    failed: bool = False


@dataclass(frozen=True, slots=True)
class Replying:
    """A piece of a reply came in: nothing to show or to record, but the run is not idle."""


@dataclass(frozen=True, slots=True)
class Turn:
    """The model has replied once; ``usage`` is that of this reply alone (nothing known: all None)."""

    usage: Usage = field(default_factory=Usage)


@dataclass(frozen=True, slots=True)
class Totals:
    """The program's own sum over the whole run; it is above what was added up from turns."""

    usage: Usage


@dataclass(frozen=True, slots=True)
class ModelProblem:
    """The model's side failed; the program may try again. ``reason`` is what it is if the run comes to nothing.

    ``final``: trying again is of no use, or the program has given up; the run is ended.
    """

    reason: ExitReason
    text: str
    final: bool = False


@dataclass(frozen=True, slots=True)
class Closed:
    """The program reports that its run is over; ``ok`` as it sees it, with its own closing words."""

    ok: bool
    text: str = ""


AgentEvent = Output | ToolCalled | ToolReturned | Replying | Turn | Totals | ModelProblem | Closed

ProgressSink = Callable[[AgentEvent, float, Usage], None]
"""Called with what happened, the seconds since the start, and what was used so far."""


class Harness(Protocol):
    """Runs an agent on one task, blocking, within ``task.limits``; leaves no process behind."""

    @property
    def name(self) -> str:
        """The name that is in the manifest."""
        ...

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """Run it; never raises for what the agent does, OSError when the attempt's own files cannot be written."""
        ...
