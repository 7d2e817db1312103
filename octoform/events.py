"""Typed progress events, from the engine up to the views.

The engine states what happens; a view decides what a person or a program sees. Every event is a frozen value whose
class name is its type in the JSON stream, so a new event is an additive change of that stream.
"""

from collections.abc import Callable

from octoform.diagnostics import Diagnostic
from octoform.records import dataclass


@dataclass(frozen=True, slots=True)
class Event:
    """Base of all events; ``node`` is the address of the graph node concerned (``identify``) or empty."""

    node: str


@dataclass(frozen=True, slots=True)
class NodeStarted(Event):
    """Work on a node begins; ``action`` is the plan's action word."""

    action: str


@dataclass(frozen=True, slots=True)
class AttemptStarted(Event):
    """An agent is started; ``number`` counts from 1, ``of`` is the budget."""

    number: int
    of: int
    harness: str


@dataclass(frozen=True, slots=True)
class AttemptProgress(Event):
    """A line that shows what the agent is doing, and how long it has run (seconds)."""

    text: str
    elapsed: float


@dataclass(frozen=True, slots=True)
class AgentActed(Event):
    """The agent uses one of its tools; ``text`` is the command, path or query on one line, ``elapsed`` seconds."""

    tool: str
    text: str
    elapsed: float


@dataclass(frozen=True, slots=True)
class AgentSpent(Event):
    """The usage of the attempt so far: replies and tokens as counts, US dollars; None is unknown."""

    turns: int
    input_tokens: int | None
    output_tokens: int | None
    cost_usd: float | None
    elapsed: float


@dataclass(frozen=True, slots=True)
class SpecEdited(Event):
    """The agent changed its own copy of the spec; ``diff`` are the lines of a unified diff, bounded.

    ``permitted`` is False when it was not asked to: then the change has no effect on the next attempt.
    """

    number: int
    permitted: bool
    diff: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class AttemptFailed(Event):
    """The attempt's output was refused or never came; the diagnostics say why."""

    number: int
    diagnostics: tuple[Diagnostic, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class Checking(Event):
    """A gate step that may take a second or more (``build environment``, ``smoke calls``)."""

    what: str


@dataclass(frozen=True, slots=True)
class StepTried(Event):
    """A test of a privileged step is over; ``text`` states what was read or seen, ``well`` that it proved its unit."""

    unit: str
    well: bool
    text: str


@dataclass(frozen=True, slots=True)
class NodeAccepted(Event):
    """The contract accepted the output; ``found`` is one line for a person (``41 devices``).

    Tokens and US dollars are those of all attempts; None is unknown.
    """

    attempts: int
    seconds: float
    found: str
    changed: bool
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None


@dataclass(frozen=True, slots=True)
class NodeUnchanged(Event):
    """A node without work: early cutoff, or the accepted artifact verified again."""

    reason: str


@dataclass(frozen=True, slots=True)
class NodeFailed(Event):
    """The node's budget is spent or its step failed; the run stops here."""

    diagnostics: tuple[Diagnostic, ...]
    seconds: float


@dataclass(frozen=True, slots=True)
class NodeDestroyed(Event):
    """A node's outputs were removed."""


@dataclass(frozen=True, slots=True)
class Notice(Event):
    """Something worth a line that is no problem (``cleared the lock of a dead process``)."""

    text: str


EventSink = Callable[[Event], None]
