"""The values that every rule shares: the artifacts so far, the facts of the profiles, and a rule itself.

A rule sees values only. It opens nothing and asks no one, so the same artifacts always give the same answer.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, Protocol

from octoform.contracts.report_context import DutyFacts
from octoform.diagnostics import Diagnostic
from octoform.records import dataclass, field

# What the rules of a privileged step are held to: its proof, the devices that it may move, the cameras there are.


class Holding(Protocol):
    """Facts of a profile: for which devices its match rule holds."""

    @property
    def holds(self) -> frozenset[str]:
        """Ids of PROBE devices."""


class KnownDevices(Protocol):
    """The facts that decide for which devices a step may run: IDENTIFY's artifact, and the profiles' facts by name."""

    @property
    def identify(self) -> Mapping[str, Any] | None:
        """The accepted artifact."""

    @property
    def profiles(self) -> Mapping[str, Holding]:
        """The facts of each profile."""


@dataclass(frozen=True, slots=True)
class StepFacts:
    """One step as octoform knows it before the agent has written anything.

    ``kind`` and ``minimum`` are those of its proof. ``devices`` are the ones that it may run for, see `corroborated`
    (with ``needs_profile`` False: any identified device). ``disabled`` are the units that the profile switches off,
    with their reasons. ``cameras`` are as the step's input has them, ``best`` the device of the one that should be
    chosen.
    """

    name: str
    kind: str
    minimum: float
    devices: tuple[str, ...] = ()
    needs_profile: bool = True
    disabled: Mapping[str, str] = field(default_factory=dict)
    cameras: tuple[Mapping[str, Any], ...] = ()
    best: str | None = None

    @property
    def idle(self) -> bool:
        """True where there is nothing to do the step with: it is skipped, and its artifact claims nothing."""
        if self.kind == "frame":
            return not self.cameras
        return self.needs_profile and not self.devices


def corroborated(profile: str, artifacts: KnownDevices) -> tuple[str, ...]:
    """The devices that a step may run for which needs that profile, in IDENTIFY's order.

    IDENTIFY identified them with it, and its match rule holds for them: neither alone is enough.
    """
    facts = artifacts.profiles.get(profile)
    devices = artifacts.identify["devices"] if artifacts.identify is not None else ()
    holds = facts.holds if facts is not None else frozenset[str]()
    return tuple(item["id"] for item in devices if item.get("profile") == profile and item["id"] in holds)


DEFAULT_TOOLS_BUDGET = 30

JsonObject = dict[str, Any]


@dataclass(frozen=True, slots=True)
class ProfileFacts:
    """octoform's own findings on one profile on this host.

    ``holds`` are the ids of the PROBE devices for which the profile's match rule holds. Of ``limits``, those
    with ``minimum`` or ``maximum`` concern the contract: they have a ``parameter``; ``tool`` narrows one to the tools
    or capabilities that this glob matches, and ``unit`` names the unit of both numbers. ``commands`` are those of its
    protocol definition as an agent gets them (``tool``, ``effect``, ``parameters`` by name), none where it has no
    protocol definition. ``product`` is what the profile calls the product, "" where it does not say, and ``grammar``
    its whole protocol definition as an agent gets it, empty without one.
    """

    name: str
    holds: frozenset[str] = frozenset()
    limits: tuple[Mapping[str, Any], ...] = ()
    commands: tuple[Mapping[str, Any], ...] = ()
    product: str = ""
    grammar: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class HostScan:
    """The embedded agent's scan of the host beside another agent's PROBE.

    ``probe`` is its own PROBE artifact; ``unsaid`` are the texts of the other's with words that the host reports
    nowhere of the device: ``id``, ``member``, ``line`` (from 1) and ``words``. ``untrue`` are the other's scans that
    are stated to have worked with a program that is not here: ``scan`` (its index), ``program``, whether the host is
    ``recorded``.
    """

    probe: JsonObject
    unsaid: tuple[JsonObject, ...] = ()
    untrue: tuple[JsonObject, ...] = ()


@dataclass(frozen=True, slots=True)
class Artifacts:
    """The accepted artifacts of the stages before the one in question; None for what does not exist yet.

    ``answers`` are a person's answers, by the device's id; ``step`` what a privileged step is held to,
    ``duty`` what the report of WATCH or HEAL is held to: what its agent was given. ``scan`` is what PROBE is held to,
    what the host itself shows; None where the embedded agent does PROBE or where no one could look. ``registered`` is
    what the host's id databases say of a device's numbers (maker and product), by its id; None where no one looked.
    ``offered`` names, by the device's id, a profile that comes with octoform, would match and is not in the manifest.
    ``python`` is the version of the interpreter that will serve, "" where that is not asked.
    """

    probe: JsonObject | None = None
    identify: JsonObject | None = None
    interface: JsonObject | None = None
    serve: str | None = None
    deploy: JsonObject | None = None
    profiles: Mapping[str, ProfileFacts] = field(default_factory=dict)
    answers: Mapping[str, str] = field(default_factory=dict)
    tools_budget: int = DEFAULT_TOOLS_BUDGET
    step: StepFacts | None = None
    duty: DutyFacts | None = None
    scan: HostScan | None = None
    registered: Mapping[str, str] | None = None
    offered: Mapping[str, str] = field(default_factory=dict)
    python: str = ""


def effects_of(artifacts: Artifacts) -> dict[str, str]:
    """The effect that IDENTIFY gives each capability, by its name; a profile's command has the profile's."""
    devices = (artifacts.identify or {"devices": []})["devices"]
    found = {capability["name"]: capability["effect"] for device in devices for capability in device["capabilities"]}
    for _, _, commands in described(artifacts.identify, artifacts):
        found |= {name: command["effect"] for name, command in commands.items() if name in found}
    return found


def described(
    identify: JsonObject | None, artifacts: Artifacts
) -> Iterator[tuple[str, str, Mapping[str, Mapping[str, Any]]]]:
    """(device, profile, commands by name) of each device with a profile's protocol definition in IDENTIFY."""
    for device in (identify or {"devices": []})["devices"]:
        facts = artifacts.profiles.get(device.get("profile", ""))
        if facts is not None and facts.commands:
            yield device["id"], facts.name, {command["tool"]: command for command in facts.commands}


def does_stop(command: Mapping[str, Any]) -> bool:
    """Whether a command of a protocol definition ends a movement, also where nothing can be interrupted."""
    return bool(command.get("do") == "stop")


def is_graver(effect: str, other: str) -> bool:
    """Whether an effect is graver than another one."""
    graveness = ("read", "actuate", "irreversible")
    return graveness.index(effect) > graveness.index(other)


RuleCheck = Callable[[Any, Artifacts], list[Diagnostic]]


@dataclass(frozen=True, slots=True)
class Rule:
    """One rule: its stable code and the pure function that finds every breach of it.

    ``check`` may rely on the schema (it runs only on a value that the schema accepts) and on the predecessor of its
    stage being there; every diagnostic that it gives carries ``code``.
    """

    code: str
    check: RuleCheck


def joined(rules: Iterable[Rule]) -> tuple[Rule, ...]:
    """One rule for each code: several ways to find the same fault are one rule to those who count them."""
    checks: dict[str, list[RuleCheck]] = {}
    for rule in rules:
        checks.setdefault(rule.code, []).append(rule.check)
    return tuple(Rule(code, parts[0] if len(parts) == 1 else _all_of(tuple(parts))) for code, parts in checks.items())


def _all_of(checks: tuple[RuleCheck, ...]) -> RuleCheck:
    return lambda value, artifacts: [item for check in checks for item in check(value, artifacts)]
