"""The plan as data: actions with reasons.

A reason is a record, not a sentence; the sentence and the JSON both come from it. Light on purpose: a plan with
nothing to do is built and shown without any heavy import.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from octoform.graph.model import Agent


class Action(StrEnum):
    """What happens to a node. The words are Terraform's."""

    CREATE = "create"
    UPDATE = "update"
    REPLACE = "replace"
    DESTROY = "destroy"
    NOOP = "no-op"


class Cause(StrEnum):
    """Why an action is planned."""

    NEW = "new"
    INTERRUPTED = "interrupted"
    FAILED = "failed"
    TAINTED = "tainted"
    REQUESTED = "requested"
    CHANGED = "changed"
    ARTIFACT_DELETED = "artifact-deleted"
    ARTIFACT_EDITED = "artifact-edited"
    ARTIFACT_LINK = "artifact-link"
    CONTRACT = "contract"
    INSTANCES_GONE = "instances-gone"
    ENDPOINT = "endpoint"
    UPSTREAM = "upstream"
    REMOVED = "removed"


@dataclass(frozen=True, slots=True)
class Reason:
    """One reason: its cause, the key part concerned, and what it was and is (digests are shortened by views)."""

    cause: Cause
    part: str | None = None
    before: str | None = None
    after: str | None = None
    text: str | None = None


@dataclass(frozen=True, slots=True)
class Loan:
    """An accepted output of another host that stands for a run of this stage's agent.

    ``certain``: the key is known to be the same. Else it fits as far as is known before the inputs are.
    """

    host: str
    output_digest: str
    certain: bool


@dataclass(frozen=True, slots=True)
class PlannedAction:
    """What the plan says of one node.

    ``certain`` is False for a node whose inputs are known only after apply: it runs only if they come out
    different. ``calls_agent`` tells whether running it starts an agent, ``calls_model`` whether that agent may
    call a model; ``escalate`` is asked for what the agent leaves unknown. ``last`` is what the accepted run of this
    node took (seconds, attempts, tokens, cost).
    """

    node: str
    action: Action
    certain: bool
    reasons: tuple[Reason, ...]
    harness: str | None = None
    model: str | None = None
    calls_agent: bool = False
    calls_model: bool = False
    escalate: Agent | None = None
    last: Mapping[str, object] = field(default_factory=dict)
    loan: Loan | None = None


@dataclass(frozen=True, slots=True)
class StepOutlook:
    """What a privileged step would do, as far as it is known before it runs.

    ``kind`` is that of its proof. ``devices`` are those whose tools it would prove; None: not known before IDENTIFY has
    run. Where there is none the step is skipped: ``profile`` is the one that holds for no device, ``near`` names a
    device for which it would hold with ``word`` in a sentence about it.
    """

    node: str
    about: str
    kind: str
    devices: tuple[str, ...] | None
    profile: str | None = None
    near: str | None = None
    word: str | None = None

    @property
    def skipped(self) -> bool:
        """True where it is known that there is nothing to do it with."""
        return self.devices == ()


@dataclass(frozen=True, slots=True)
class OpenQuestion:
    """A device whose meaning is missing, and the one sentence that would supply it.

    ``tier`` says what such a sentence has to hold: 2 a name, 3 a description of how the device is used.
    """

    device: str
    seen_as: str
    sentence: str
    tier: int = 2


@dataclass(frozen=True, slots=True)
class ToldDevice:
    """A device that is named, and how much a person had to say for that: tier 1 nothing, 2 a name, 3 a description."""

    device: str
    name: str
    tier: int
    answer: str | None = None
    profile: str | None = None


@dataclass(frozen=True, slots=True)
class ProfileUse:
    """A profile that holds for a device (``NOOP``), would then hold (``CREATE``) or no longer would (``DESTROY``)."""

    profile: str
    device: str
    action: Action


@dataclass(frozen=True, slots=True)
class NearProfile:
    """A profile that would hold for a device if a person said the word of it: all else that its rule asks is there."""

    profile: str
    device: str
    word: str


@dataclass(frozen=True, slots=True)
class Change:
    """A device or tool that appears, changes or goes, as far as it is known before anything runs."""

    kind: str
    name: str
    action: Action
    text: str = ""


@dataclass(frozen=True, slots=True)
class Plan:
    """All actions of one operation on one host, in the order of work.

    ``tier1``: made as if no person had said anything of the hardware, without profiles and answers.
    """

    host: str
    operation: str
    actions: tuple[PlannedAction, ...]
    lineage: str | None = None
    serial: int = 0
    revision: str | None = None
    dirty: tuple[str, ...] = ()
    changes: tuple[Change, ...] = ()
    questions: tuple[OpenQuestion, ...] = ()
    devices: tuple[ToldDevice, ...] = ()
    profiles: tuple[ProfileUse, ...] = ()
    near: tuple[NearProfile, ...] = ()
    tier1: bool = False
    targets: tuple[str, ...] = ()
    steps: tuple[StepOutlook, ...] = ()

    @property
    def work(self) -> tuple[PlannedAction, ...]:
        """The actions that are not no-ops."""
        return tuple(item for item in self.actions if item.action is not Action.NOOP)

    @property
    def empty(self) -> bool:
        """True when nothing would be done."""
        return not self.work

    def count(self, action: Action, *, certain: bool = True) -> int:
        """How many actions of that kind are planned, certain ones or those that depend on an outcome."""
        return sum(1 for item in self.actions if item.action is action and item.certain is certain)
