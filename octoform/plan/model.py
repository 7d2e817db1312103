"""The plan as data: actions with reasons.

A reason is a record, not a sentence; the sentence and the JSON both come from it. Light on purpose: a plan with
nothing to do is built and shown without any heavy import.
"""

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

from octoform.graph.model import Agent
from octoform.records import dataclass, field


class Action(StrEnum):
    """The action on a node. The words are Terraform's."""

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
class Reuse:
    """An accepted output of another host that stands for a run of this stage's agent.

    ``certain``: the key is known to be the same. Else it fits as far as is known before the inputs are.
    """

    host: str
    output_digest: str
    certain: bool


@dataclass(frozen=True, slots=True)
class PlannedAction:
    """The plan's entry for one node.

    ``certain`` is False for a node whose inputs are known only after apply: it runs only if they come out
    different. ``calls_agent`` shows whether running it starts an agent, ``calls_model`` whether that agent may
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
    loan: Reuse | None = None


@dataclass(frozen=True, slots=True)
class StepOutlook:
    """The outlook of a privileged step, as far as it is known before it runs.

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
    """An unidentified device, and the one sentence that would supply it.

    ``tier`` states what such a sentence has to hold: 2 a name, 3 a description of how the device is used.
    """

    device: str
    seen_as: str
    sentence: str
    tier: int = 2


@dataclass(frozen=True, slots=True)
class NamedDevice:
    """A device that is named, and a person's input for that by the paper's tiers: 1 none, 2 a name, 3 a description."""

    device: str
    name: str
    tier: int
    answer: str | None = None
    profile: str | None = None


@dataclass(frozen=True, slots=True)
class ProfileUse:
    """A profile that matches a device (``NOOP``), will match it (``CREATE``) or no longer will (``DESTROY``)."""

    profile: str
    device: str
    action: Action


@dataclass(frozen=True, slots=True)
class NearProfile:
    """A profile that would match a device if a person's answer had its word: all else of its rule is met."""

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

    ``tier1``: made as if no person had described the hardware, without profiles and answers.
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
    devices: tuple[NamedDevice, ...] = ()
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


# A plan as plain JSON values and back: the form that views stream, plan files keep and the memo remembers.

FORMAT = 1
TOOL = "tool"
"""The kind of a change of a tool; every other one is of the hardware."""
_ABSENT = ("escalate", "loan")
"""Fields of an action that are there only where they say something."""


def to_json(plan: Plan) -> dict[str, Any]:
    """All of a plan as JSON values; absent facts are omitted from reasons."""
    from dataclasses import asdict  # who only reads a plan does not wait for it

    out: dict[str, Any] = {"format": FORMAT, **asdict(plan)}
    out["actions"] = [_action(item) for item in plan.actions]
    out["changes"] = [asdict(item) for item in plan.changes]
    for name in ("questions", "devices", "profiles", "near"):
        out[name] = [asdict(item) for item in getattr(plan, name)]
    if plan.steps:
        out["steps"] = [{**asdict(item), "devices": _listed(item.devices)} for item in plan.steps]
    else:
        del out["steps"]
    return out


def _listed(names: tuple[str, ...] | None) -> list[str] | None:
    return None if names is None else list(names)


def _action(item: PlannedAction) -> dict[str, Any]:
    from dataclasses import asdict

    out = asdict(item)
    out["reasons"] = [
        {key: value for key, value in asdict(reason).items() if value is not None} for reason in item.reasons
    ]
    return {key: value for key, value in out.items() if value is not None or key not in _ABSENT}


def from_json(data: Mapping[str, Any]) -> Plan:
    """The plan again; KeyError, TypeError or ValueError when ``data`` is not what `to_json` gives."""
    fields = {key: value for key, value in data.items() if key != "format"}
    fields["actions"] = tuple(_read_action(item) for item in data["actions"])
    fields["changes"] = tuple(Change(**{**item, "action": Action(item["action"])}) for item in data["changes"])
    fields["questions"] = tuple(OpenQuestion(**item) for item in data["questions"])
    fields["devices"] = tuple(NamedDevice(**item) for item in data.get("devices", ()))
    uses = data.get("profiles", ())
    fields["profiles"] = tuple(ProfileUse(**{**item, "action": Action(item["action"])}) for item in uses)
    fields["near"] = tuple(NearProfile(**item) for item in data.get("near", ()))
    fields["steps"] = tuple(_read_step(item) for item in data.get("steps", ()))
    fields["dirty"] = tuple(data["dirty"])
    fields["targets"] = tuple(data["targets"])
    return Plan(**fields)


def _read_step(item: Mapping[str, Any]) -> StepOutlook:
    devices = item["devices"]
    return StepOutlook(**{**item, "devices": None if devices is None else tuple(devices)})


def _read_action(item: Mapping[str, Any]) -> PlannedAction:
    reasons = tuple(Reason(**{**reason, "cause": Cause(reason["cause"])}) for reason in item["reasons"])
    more: dict[str, Any] = {"loan": Reuse(**item["loan"])} if "loan" in item else {}
    more |= {"escalate": Agent(**item["escalate"])} if "escalate" in item else {}
    return PlannedAction(**{**item, "action": Action(item["action"]), "reasons": reasons, **more})
