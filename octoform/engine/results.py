"""The results of the engine's operations, for views. Light: no heavy import."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Protocol

from octoform.diagnostics import Diagnostic
from octoform.events import Event
from octoform.plan.model import OpenQuestion, Plan
from octoform.records import dataclass, field


@dataclass(frozen=True, slots=True)
class Funnel:
    """From what the operating system shows to what can be called, as counts of devices and tools."""

    seen: int
    annotated: int
    unknown: int
    left_out: int
    tools: int


@dataclass(frozen=True, slots=True)
class EndpointSummary:
    """The live endpoint: what a client of this machine starts, its tools, and a read tool that answered.

    ``url`` is where it answers over HTTP; None in scope local. ``token`` names one that opens it there, ``denied``
    counts the tools that the policy keeps from everybody. ``public`` is where it answers through the tunnel of scope
    internet; None where there is none, or none that runs.
    """

    command: str
    scope: str
    url: str | None
    tools: tuple[str, ...]
    answered: str | None = None
    example: str | None = None
    token: str | None = None
    denied: int = 0
    public: str | None = None


@dataclass(frozen=True, slots=True)
class RunUsage:
    """The usage of a run's agents: tokens as counts, US dollars and who priced them; None is unknown."""

    input_tokens: int | None = None
    cached_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    cost_source: str | None = None


@dataclass(frozen=True, slots=True)
class RunResult:
    """How an apply or a destroy ended; ``failed`` names the node that stopped it.

    ``questions`` are those that are open: one for each unidentified device. ``incomplete`` are the ids of
    served devices that this user may not use, ``silent`` states that most of the endpoint's read tools did not answer
    in this run, empty where they did: nothing failed, and the host is degraded. ``recorded`` is the folder of a
    recorded host, whose devices cannot be opened.
    """

    operation: str
    host: str
    added: int = 0
    changed: int = 0
    alike: int = 0
    destroyed: int = 0
    agent_runs: int = 0
    usage: RunUsage = field(default_factory=RunUsage)
    seconds: float = 0.0
    failed: str | None = None
    refused: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    funnel: Funnel | None = None
    questions: tuple[OpenQuestion, ...] = ()
    endpoint: EndpointSummary | None = None
    commit: str | None = None
    incomplete: tuple[str, ...] = ()
    silent: str = ""
    recorded: str = ""


@dataclass(frozen=True, slots=True)
class PlanResult:
    """A plan, or the diagnostics that prevented it."""

    plan: Plan | None
    diagnostics: tuple[Diagnostic, ...] = ()
    saved_as: str | None = None


# What the engine asks of a view during a run.


class RunView(Protocol):
    """Shows a run and asks for approval."""

    def plan(self, plan: Plan) -> None:
        """Show what is going to be done."""

    def approve(self) -> bool:
        """Ask the person; False when the answer is not yes or no one can be asked."""

    def watching(self) -> AbstractContextManager[Callable[[Event], None]]:
        """A context that gives the sink for events."""

    def ended(self, result: RunResult) -> None:
        """Show how it ended."""


# The view of an unattended run; its actions are in the execution log.


class Unwatched:
    """Shows nothing, and can ask no one."""

    def plan(self, plan: Plan) -> None:
        """No one looks at it."""

    def approve(self) -> bool:
        """No one can be asked."""
        return False

    @contextmanager
    def watching(self) -> Iterator[Callable[[Event], None]]:
        """Events are only logged."""
        yield lambda _: None

    def ended(self, result: RunResult) -> None:
        """No one is shown it."""
