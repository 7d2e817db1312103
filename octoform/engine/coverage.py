"""How much of a host's hardware can be used, as a pure function of the accepted artifacts.

Every device that PROBE listed is in the report exactly once, with what became of it, so that the figures can be
counted after. What a figure rests on and is not there yet is None, never 0.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import Any

from octoform.base import digest
from octoform.base.files import read_plain
from octoform.contracts.artifact_parser import parse
from octoform.contracts.contract_check import has_shape
from octoform.contracts.rules.identify.answer_rules import tier, wanted
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.drift import observe as observe_endpoint
from octoform.endpoint.expected_tools import hidden
from octoform.engine.coverage_runs import Output, Pass, Run, Stability, compare, grouped, passes, runs
from octoform.engine.coverage_runs import run_of as stable_run
from octoform.engine.inspect.attempts import MAX_TASK_BYTES, Attempt, of_host, run_of
from octoform.engine.inspect.devices import lacking
from octoform.engine.inspect.state import open_project
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import Compiled
from octoform.engine.plan.refresh import read_artifacts
from octoform.graph.model import ANSWER, input_of
from octoform.harness.event_parser import json_object
from octoform.records import dataclass, field, replace
from octoform.state.accepted import observe as observe_files
from octoform.state.files import display, write_atomic
from octoform.state.layout import STAGES, Layout
from octoform.state.model import NodeState, Snapshot, Status

UNKNOWN = "unknown"
INFRASTRUCTURE = "infrastructure"
BESIDE = frozenset(
    {"bus_infrastructure", "no_function", "virtual", "duplicate_path", "out_of_scope", "network_neighbour"}
)
"""Reasons that say: there is nothing here that could be used, or it is counted elsewhere, or it is not this host's."""


OFFERED = "profile_offered"
"""Why a device that could be used has no tool although a profile that comes with octoform matches it."""


class Standing(StrEnum):
    """The coverage of a device that PROBE listed."""

    USABLE = "usable"
    NAMED = "named"
    UNKNOWN = "unknown"
    LEFT_OUT = "left_out"
    WAITING = "waiting"


class Counted(StrEnum):
    """Where a device counts: among the eligible ones, as infrastructure, or beside both; ``open`` is not decided."""

    ONBOARDABLE = "onboardable"
    INFRASTRUCTURE = "infrastructure"
    BESIDE = "beside"
    OPEN = "open"


@dataclass(frozen=True, slots=True)
class Device:
    """One device of PROBE. Texts are foreign.

    ``identified_as`` to ``tier`` are IDENTIFY's, empty or None where it does not annotate the device. ``reason`` and
    ``detail`` say why it has no tool; ``question`` is the one sentence that an unknown device misses. ``offer`` names a
    profile that comes with octoform and matches, and the line of the manifest that uses it.
    """

    id: str
    seen_as: str
    bus: str
    standing: Standing
    counted: Counted
    identified_as: str = ""
    category: str = ""
    kind: str = ""
    confidence: float | None = None
    method: str = ""
    profile: str = ""
    tier: int | None = None
    answered: bool = False
    capabilities: tuple[str, ...] = ()
    tools: tuple[str, ...] = ()
    reason: str = ""
    detail: str = ""
    question: str = ""
    offer: str = ""

    @property
    def usable(self) -> bool:
        """True for a device that a tool serves and that this user may use."""
        return self.standing is Standing.USABLE


@dataclass(frozen=True, slots=True)
class Share:
    """``usable`` of ``of`` devices."""

    usable: int
    of: int

    @property
    def percent(self) -> float | None:
        """0 to 100; None where there is nothing to be a share of."""
        return 100 * self.usable / self.of if self.of else None


@dataclass(frozen=True, slots=True)
class Group:
    """The identified devices of one category or class, how many of them have tools, and how many tools those are."""

    name: str
    annotated: int
    usable: int
    tools: int


@dataclass(frozen=True, slots=True)
class Funnel:
    """From all that the operating system shows to tools; ``annotated`` counts what IDENTIFY left unknown too."""

    enumerated: int
    annotated: int | None
    unknown: int | None
    with_tools: int | None
    tools: int | None

    @property
    def identified(self) -> int | None:
        """The devices that IDENTIFY has identified on evidence."""
        return None if self.annotated is None or self.unknown is None else self.annotated - self.unknown


@dataclass(frozen=True, slots=True)
class Coverage:
    """The coverage of one host by its artifacts."""

    devices: tuple[Device, ...]
    funnel: Funnel
    onboardable: Share | None
    with_infrastructure: Share | None
    categories: tuple[Group, ...]
    kinds: tuple[Group, ...]
    denied: tuple[str, ...] = ()

    def of(self, *standings: Standing) -> tuple[Device, ...]:
        """The devices of some standings, in PROBE's order."""
        return tuple(item for item in self.devices if item.standing in standings)

    def left_out(self) -> dict[str, tuple[Device, ...]]:
        """The devices without annotation by the reason, the most frequent first."""
        found: dict[str, list[Device]] = {}
        for item in self.of(Standing.LEFT_OUT):
            found.setdefault(item.reason, []).append(item)
        order = sorted(found, key=lambda reason: (-len(found[reason]), reason))
        return {reason: tuple(found[reason]) for reason in order}


@dataclass(frozen=True, slots=True)
class Ground:
    """The inputs of coverage: accepted artifacts by stage, answers and tiers by device, tools denied to all.

    ``closed`` are devices that this user may not use now, each with the sentence that states why; ``offers`` are
    devices that a profile matches which the manifest does not name, each with the profile and the line that names it.
    """

    artifacts: Mapping[str, Any]
    answers: Mapping[str, str] = field(default_factory=dict)
    tiers: Mapping[str, int] = field(default_factory=dict)
    denied: frozenset[str] = frozenset()
    closed: Mapping[str, str] = field(default_factory=dict)
    offers: Mapping[str, str] = field(default_factory=dict)


def coverage(ground: Ground) -> Coverage:
    """The coverage; PROBE's artifact has to be there."""
    devices = tuple(_offered(item, ground.offers.get(item.id, "")) for item in _devices(ground))
    identified, decided = "identify" in ground.artifacts, "interface" in ground.artifacts
    annotated = [item for item in devices if item.category]
    usable = [item for item in annotated if item.tools]
    names = {name for item in usable for name in item.tools}
    return Coverage(
        devices=devices,
        funnel=Funnel(
            enumerated=len(devices),
            annotated=len(annotated) if identified else None,
            unknown=sum(item.category == UNKNOWN for item in annotated) if identified else None,
            with_tools=len(usable) if decided else None,
            tools=len(names) if decided else None,
        ),
        onboardable=_share(devices, Counted.ONBOARDABLE) if decided else None,
        with_infrastructure=_share(devices, Counted.ONBOARDABLE, Counted.INFRASTRUCTURE) if decided else None,
        categories=_groups((item.category, item) for item in annotated),
        kinds=_groups((item.kind or "(none)", item) for item in annotated),
        denied=tuple(sorted(names & ground.denied)),
    )


def _share(devices: Sequence[Device], *counted: Counted) -> Share:
    chosen = [item for item in devices if item.counted in counted]
    return Share(sum(1 for item in chosen if item.usable), len(chosen))


def _groups(named: Iterable[tuple[str, Device]]) -> tuple[Group, ...]:
    """The largest first."""
    members: dict[str, list[Device]] = {}
    for name, item in named:
        members.setdefault(name, []).append(item)
    groups = [
        Group(
            name=name,
            annotated=len(items),
            usable=sum(1 for item in items if item.usable),
            tools=len({tool for item in items for tool in item.tools}),
        )
        for name, items in members.items()
    ]
    return tuple(sorted(groups, key=lambda group: (-group.annotated, group.name)))


def _devices(ground: Ground) -> Iterable[Device]:
    identify, interface = ground.artifacts.get("identify"), ground.artifacts.get("interface")
    annotated = {item["id"]: item for item in (identify or {"devices": []})["devices"]}
    # INTERFACE speaks last: it also gives the reason why an identified device has no tool.
    left = {item["id"]: item for stage in (identify, interface) if stage for item in stage["left_out"]}
    tools = tools_by_device(interface)
    for seen in ground.artifacts["probe"]["devices"]:
        name = seen["id"]
        base = {"id": name, "seen_as": seen["name"], "bus": seen["interface"], "answered": name in ground.answers}
        if name in annotated:
            found = _identified(annotated[name], tools.get(name, ()), left.get(name, {}))
            if found["tools"] and name in ground.closed:
                found |= {"standing": Standing.NAMED, "reason": "not_permitted", "detail": ground.closed[name]}
            yield Device(**base, tier=ground.tiers.get(name), **found)
        else:
            yield Device(**base, **_unannotated(left.get(name)))


def _offered(item: Device, offer: str) -> Device:
    """The device with what is offered for it; where that would help, it is the reason that the device has no tool."""
    if not offer or item.tools or item.counted is not Counted.ONBOARDABLE:
        return replace(item, offer=offer)
    return replace(item, offer=offer, reason=OFFERED, detail=offer)


def tools_by_device(interface: Mapping[str, Any] | None) -> dict[str, tuple[str, ...]]:
    """The names of each device's tools, in INTERFACE's order."""
    found: dict[str, list[str]] = {}
    for tool in (interface or {"tools": []})["tools"]:
        for name in tool["devices"]:
            found.setdefault(name, []).append(tool["name"])
    return {name: tuple(names) for name, names in found.items()}


def _identified(item: Mapping[str, Any], tools: tuple[str, ...], left: Mapping[str, Any]) -> dict[str, Any]:
    category, question = item["category"], item.get("missing", "")
    without = Standing.UNKNOWN if category == UNKNOWN else Standing.NAMED
    detail = left.get("detail", "")
    return {
        "standing": Standing.USABLE if tools else without,
        "counted": Counted.INFRASTRUCTURE if category == INFRASTRUCTURE else Counted.ONBOARDABLE,
        "identified_as": item["identified_as"],
        "category": category,
        "kind": item.get("class", ""),
        "confidence": item["confidence"],
        "method": item["method"],
        "profile": item.get("profile", ""),
        "capabilities": tuple(one["name"] for one in item["capabilities"]),
        "tools": tools,
        "reason": "" if tools else left.get("reason", ""),
        "detail": "" if tools or detail == question else detail,
        "question": question if category == UNKNOWN else "",
    }


def _unannotated(left: Mapping[str, Any] | None) -> dict[str, Any]:
    if left is None:
        return {"standing": Standing.WAITING, "counted": Counted.OPEN}
    reason = left["reason"]
    return {
        "standing": Standing.LEFT_OUT,
        "counted": Counted.BESIDE if reason in BESIDE else Counted.ONBOARDABLE,
        "reason": reason,
        "detail": left.get("detail", ""),
    }


# Coverage of a project's host: reads what was accepted and what the attempts left, and starts nothing. (Heavy.)
#
# What it gathers are kinds: no serial number, address or host name is in an accepted artifact, and nothing else of
# the devices is read. So a report may be given away.
#
# What limits a report of coverage, in sentences: what is not there yet, out of date, edited, or not what it claims.


def notes(snapshot: Snapshot, artifacts: Mapping[str, Any], files: Mapping[str, str | None]) -> Iterator[str]:
    """Stage by stage; ``artifacts`` are those that the report rests on, ``files`` the digests of what lies there."""
    never = []
    for name in STAGES:
        state = snapshot.nodes.get(name)
        if state is not None:
            yield from (f"{name.upper()}: {text}" for text in _of(state, name in artifacts, files[name]))
        if state is not None and name in artifacts:
            yield from _older(name, state, snapshot)
        if state is None or not state.output_digest:
            never.append(name.upper())
    until = "; no tool can be called until then" if "interface" in artifacts else ""
    if never:
        yield f"not there yet: {', '.join(never)}; octoform apply makes it{until}"


def _of(state: NodeState, used: bool, digest: str | None) -> Iterator[str]:
    """The view of one stage by itself."""
    if state.status is not Status.ACCEPTED:
        ended = "was interrupted" if state.status is Status.INTERRUPTED else "failed"
        kept = "what was accepted before is shown" if used else "nothing of it was accepted yet"
        yield f"its last run {ended}; {kept}"
    if used and digest != state.file_digest:
        yield "its accepted output was edited by hand; what lies there is shown"
    if not used and state.output_digest:
        left = "gone" if digest is None else "skipped, for it or what it rests on cannot be read"
        yield f"its accepted output is {left}; octoform apply makes it again"


def _older(name: str, state: NodeState, snapshot: Snapshot) -> Iterator[str]:
    made_of = {input_of(part): digest for part, digest in state.key_parts.items()}
    before = [part for part in STAGES if part in made_of and part in snapshot.nodes]
    older = [part for part in before if made_of[part] != snapshot.nodes[part].output_digest]
    if older:
        yield f"{name.upper()}: made from an earlier output of {older[0].upper()}; octoform apply renews it"


MAX_OUTPUT_BYTES = 8 << 20
MAX_SPEC_BYTES = 1 << 20


@dataclass(frozen=True, slots=True)
class Stage:
    """The cost of a stage's accepted output, all of its attempts together; ``seconds`` are wall time."""

    name: str
    agent: str
    attempts: int
    seconds: float
    accepted_at: str
    input_tokens: int | None
    output_tokens: int | None
    cost_usd: float | None


@dataclass(frozen=True, slots=True)
class CoverageReport:
    """Everything that ``octoform coverage`` reports.

    ``endpoint`` is ``running``, ``stopped`` or ``absent``. ``notes`` are sentences on what limits the rest: what is not
    there yet, what is out of date.
    """

    platform: Mapping[str, str]
    coverage: Coverage
    stability: Stability | None
    stages: tuple[Stage, ...]
    passes: tuple[Pass, ...]
    endpoint: str
    notes: tuple[str, ...] = ()


def report(project: Path, environ: Mapping[str, str]) -> tuple[CoverageReport | None, list[Diagnostic]]:
    """The report of the folder's host; COVERAGE-NOTHING where PROBE has no accepted output."""
    opened, found = open_project(project, environ)
    if opened is None:
        return None, found
    compiled, snapshot = opened.compiled, opened.snapshot
    files = {stage: facts.digest for stage, facts in observe_files(compiled.layout).items()}
    artifacts = _accepted(read_artifacts(compiled, snapshot, files), snapshot)
    if "probe" not in artifacts:
        return None, [*found, _nothing(compiled.layout, snapshot)]
    attempts = [item for item in of_host(compiled.layout) if item.stage in STAGES]
    groups, output = grouped(attempts), _outputs(compiled.schemas)
    endpoint, heard = observe_endpoint(compiled.layout), _heard(snapshot)
    made = CoverageReport(
        platform={name: str(value) for name, value in artifacts["probe"]["platform"].items() if name != "kernel"},
        coverage=coverage(replace(_ground(compiled, artifacts, heard), closed=lacking(compiled.layout, environ))),
        stability=_stability(artifacts, snapshot, attempts, runs(groups, output)),
        stages=tuple(_stage(name, snapshot.nodes[name]) for name in STAGES if name in artifacts),
        passes=passes(groups, output),
        endpoint="running" if endpoint.process is not None else "stopped" if endpoint.present else "absent",
        notes=(*notes(snapshot, artifacts, files), *_waiting(artifacts, compiled.manifest.answers, heard)),
    )
    lines = (*device_knowledge.offers(artifacts, compiled), *device_knowledge.unmatched(artifacts, compiled))
    return made, [*found, *lines]


def save(path: Path, text: str) -> Diagnostic | None:
    """Write a page that others may read; None when it stands."""
    return write_atomic(path, text.encode("utf-8", "backslashreplace"), 0o644)


def _accepted(artifacts: Mapping[str, Any], snapshot: Snapshot) -> dict[str, Any]:
    """The artifacts that were accepted, without a stage whose predecessor is missing: it would speak of nothing."""
    found: dict[str, Any] = {}
    for stage in STAGES:
        state = snapshot.nodes.get(stage)
        if state is None or not state.output_digest or stage not in artifacts:
            break
        found[stage] = artifacts[stage]
    return found


def _nothing(layout: Layout, snapshot: Snapshot) -> Diagnostic:
    if "probe" in snapshot.nodes and not layout.output("probe").exists():
        summary = "the accepted output of PROBE is gone, so there is nothing to report on"
    else:
        summary = "no device is known yet: PROBE has no accepted output"
    return error("COVERAGE-NOTHING", summary, path=display(layout.output("probe")), hint="octoform apply makes it")


def _heard(snapshot: Snapshot) -> dict[str, str]:
    """The answers that the accepted IDENTIFY was made with, by device."""
    parts = snapshot.nodes["identify"].key_parts if "identify" in snapshot.nodes else {}
    return {name.removeprefix(ANSWER): text for name, text in parts.items() if name.startswith(ANSWER)}


def _waiting(artifacts: Mapping[str, Any], answers: Mapping[str, str], heard: Mapping[str, str]) -> list[str]:
    devices = {device["id"] for device in artifacts["probe"]["devices"]}
    names = sorted(name for name, text in answers.items() if name in devices and heard.get(name) != text)
    return [f"answered since: {', '.join(names)}; octoform apply takes it into account"] if names else []


def _ground(compiled: Compiled, artifacts: Mapping[str, Any], answers: Mapping[str, str]) -> Ground:
    descriptions = {profile.name for profile in compiled.profiles if profile.describes}
    annotated = artifacts.get("identify", {"devices": []})["devices"]
    tiers = {item["id"]: wanted(item) or tier(item, answers, descriptions) for item in annotated}
    found = device_knowledge.offered(artifacts, compiled)
    offers = {device: f"{each.profile}: {each.line}" for each in reversed(found) for device in each.devices}
    return Ground(artifacts, answers, tiers, hidden(compiled.layout), offers=offers)


def _outputs(schemas: Path) -> Output:
    """Reads what an attempt wrote, each once; None for what cannot be read or has no longer the stage's shape."""
    known: dict[int, Mapping[str, Any] | None] = {}

    def read(item: Attempt) -> Mapping[str, Any] | None:
        if item.number not in known:
            data = read_plain(item.folder / "output.json", MAX_OUTPUT_BYTES) or b""
            value, _ = parse(item.stage, data, "output.json")
            whole = isinstance(value, dict) and has_shape(item.stage, value, schemas)
            known[item.number] = value if isinstance(value, dict) and whole else None
        return known[item.number]

    return read


def _stability(
    artifacts: Mapping[str, Any], snapshot: Snapshot, attempts: Sequence[Attempt], found: Sequence[tuple[Attempt, Run]]
) -> Stability | None:
    """The coverage of the runs with the same inputs as the latest; the accepted artifacts where no run is kept here."""
    if "identify" not in artifacts:
        return None
    if not found:
        agent = _stage("identify", snapshot.nodes["identify"]).agent
        return compare([stable_run(agent, artifacts["identify"], artifacts.get("interface"))])
    given = [_given(run_of(attempts, item)[0].folder) for item, _ in found]
    same = [run for (_, run), one in zip(found, given, strict=True) if one == given[-1]]
    return compare(same, skipped=len(found) - len(same))


def _given(folder: Path) -> str:
    """Digest of what an agent was given beside the devices: spec, answers, profiles."""
    task = json_object(read_plain(folder / "task.json", MAX_TASK_BYTES) or b"") or {}
    spec = read_plain(folder / "spec.md", MAX_SPEC_BYTES) or b""
    fields = {name: task.get(name) or None for name in ("answers", "profiles")}
    return digest.of_value({"spec": digest.of_bytes(spec), **fields})


def _stage(name: str, state: NodeState) -> Stage:
    used = state.usage
    agent = f"{state.harness}, {state.model}" if state.model else state.harness or ""
    spent = (used.input_tokens, used.output_tokens, used.cost_usd)
    return Stage(name, agent, state.attempts, state.seconds, state.accepted_at or "", *spent)
