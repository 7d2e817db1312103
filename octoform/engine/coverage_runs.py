"""The attempts of a host as passes through the stages, each with what it took and what it came to.

A person applies, and the stages that have work run one after the other: that is a pass. Attempts are numbered over
all of them, so a pass ends where the next attempt is of an earlier stage, or begins a stage again.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar

from octoform.apply.stage.escalation import merged
from octoform.engine.inspect.attempts import ACCEPTED, REUSE, Attempt
from octoform.graph.compile import RETURNS
from octoform.records import dataclass, field, replace
from octoform.state.layout import STAGES

# Whether a host's devices are identified the same in every run, and the same way usable; pure.
#
# Whether a name is right cannot be known here. That two runs over the same evidence disagree can be known, and it is
# looked for in what the contract holds: the device, what it is, and what it can do. A tool may have another name in
# every run; where it serves the same capability of the same device, that is a rename and no disagreement.

LEFT_OUT = "skipped"
MISSING = "missing"


class Ability(NamedTuple):
    """A capability of a device: the unit in which runs are compared."""

    device: str
    capability: str


class Way(NamedTuple):
    """How a capability acts, and through which library or interface: the same whatever it is called."""

    effect: str
    via: str


@dataclass(frozen=True, slots=True)
class Identity:
    """One run's annotation of one device; ``capabilities`` by name."""

    identified_as: str
    category: str
    capabilities: Mapping[str, Way] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Run:
    """One accepted IDENTIFY, and what INTERFACE made of it where it is known."""

    agent: str
    devices: Mapping[str, Identity]
    tools: Mapping[Ability, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Disagreement:
    """One thing in which runs differ about a device: ``identities`` are the different words, each with how many runs.

    ``aspect`` is ``annotated``, ``identity``, ``category`` or ``capability``; ``what`` names the capability.
    """

    device: str
    aspect: str
    said: tuple[tuple[str, int], ...]
    what: str = ""


@dataclass(frozen=True, slots=True)
class Renamed:
    """A tool that was called differently in some runs, for the same capability of the same devices."""

    capability: str
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Stability:
    """The agreement of N runs. ``compared`` devices are in at least two runs, ``same`` of them alike in all of theirs.

    ``agents`` are who ran, with how many runs. ``core`` are the abilities of every run, ``abilities`` how many there
    were in any, ``names`` how many different names their tools had. ``skipped`` runs were given something else than
    the latest, and are not compared.
    """

    runs: int
    agents: tuple[tuple[str, int], ...]
    compared: int = 0
    same: int = 0
    disagreements: tuple[Disagreement, ...] = ()
    core: tuple[Ability, ...] = ()
    abilities: int = 0
    names: int = 0
    renamed: tuple[Renamed, ...] = ()
    skipped: int = 0


def run_of(agent: str, identify: Mapping[str, Any], interface: Mapping[str, Any] | None) -> Run:
    """A run from its artifacts."""
    devices = {item["id"]: Identity(LEFT_OUT, LEFT_OUT) for item in identify["left_out"]}
    for item in identify["devices"]:
        able = {one["name"]: Way(one["effect"], one["via"]) for one in item["capabilities"]}
        devices[item["id"]] = Identity(item["identified_as"], item["category"], able)
    tools = {
        Ability(device, tool["capability"]): tool["name"]
        for tool in (interface or {"tools": []})["tools"]
        for device in tool["devices"]
    }
    return Run(agent, devices, tools)


def compare(given: Sequence[Run], skipped: int = 0) -> Stability:
    """Compute the agreement of the runs."""
    runs, renamed = _aligned(given)
    several = {name: text for name, text in _by_device(runs).items() if len(text) > 1}
    found = [item for name, text in several.items() for item in _differences(name, text)]
    abilities = [_abilities(run) for run in runs]
    return Stability(
        runs=len(runs),
        agents=tuple(Counter(run.agent for run in runs).most_common()),
        compared=len(several),
        same=len(several) - len({item.device for item in found}),
        disagreements=tuple(found),
        core=tuple(sorted(set.intersection(*abilities))) if abilities else (),
        abilities=len(set().union(*abilities)),
        names=len({name for run in runs for name in run.tools.values()}),
        renamed=renamed,
        skipped=skipped,
    )


def _by_device(runs: Sequence[Run]) -> dict[str, list[Identity]]:
    names = dict.fromkeys(name for run in runs for name in run.devices)
    return {name: [run.devices[name] for run in runs if name in run.devices] for name in names}


def _abilities(run: Run) -> set[Ability]:
    return {Ability(device, name) for device, text in run.devices.items() for name in text.capabilities}


def _differences(device: str, identities: Sequence[Identity]) -> list[Disagreement]:
    """In what the runs differ; of a device that some skipped nothing else is reported."""
    left = ["skipped" if item.category == LEFT_OUT else "identified" for item in identities]
    if len(set(left)) > 1:
        return [Disagreement(device, "identified", _counted(left))]
    fields = {
        "identity": [item.identified_as for item in identities],
        "category": [item.category for item in identities],
    }
    found = [Disagreement(device, aspect, _counted(words)) for aspect, words in fields.items() if len(set(words)) > 1]
    for name in dict.fromkeys(name for item in identities for name in item.capabilities):
        effects = [item.capabilities[name].effect if name in item.capabilities else MISSING for item in identities]
        if len(set(effects)) > 1:
            found.append(Disagreement(device, "capability", _counted(effects), name))
    return found


def _counted(words: Sequence[str]) -> tuple[tuple[str, int], ...]:
    return tuple(Counter(words).most_common())


def _aligned(runs: Sequence[Run]) -> tuple[list[Run], tuple[Renamed, ...]]:
    """The runs with one name for what is the same capability, and which tools were called differently."""
    alias = {
        Ability(device, name): best
        for device, text in _by_device(runs).items()
        for best, names in _same_way([item for item in text if item.category != LEFT_OUT])
        for name in names
    }
    aligned = [_renaming(run, alias) for run in runs]
    called: dict[str, dict[str, None]] = {}
    for ability in dict.fromkeys(ability for run in aligned for ability in run.tools):
        names = dict.fromkeys(run.tools[ability] for run in aligned if ability in run.tools)
        if len(names) > 1:
            called.setdefault(ability.capability, {}).update(names)
    return aligned, tuple(Renamed(capability, tuple(names)) for capability, names in sorted(called.items()))


def _same_way(identities: Sequence[Identity]) -> list[tuple[str, list[str]]]:
    """Names of one capability, the most frequent and all: in every run it alone has that effect in that way."""
    found = []
    for way in dict.fromkeys(way for item in identities for way in item.capabilities.values()):
        in_runs = [[name for name, other in item.capabilities.items() if other == way] for item in identities]
        names = [name for several in in_runs for name in several]
        alone = all(len(several) == 1 for several in in_runs)
        elsewhere = any(item.capabilities.get(name, way) != way for item in identities for name in names)
        if alone and not elsewhere and len(set(names)) > 1:
            found.append((Counter(names).most_common(1)[0][0], names))
    return found


def _renaming(run: Run, alias: Mapping[Ability, str]) -> Run:
    devices = {
        device: replace(
            text, capabilities={alias.get(Ability(device, name), name): way for name, way in text.capabilities.items()}
        )
        for device, text in run.devices.items()
    }
    tools = {
        ability._replace(capability=alias.get(ability, ability.capability)): name for ability, name in run.tools.items()
    }
    return replace(run, devices=devices, tools=tools)


ESCALATE = "escalate"
Number = TypeVar("Number", int, float)
Output = Callable[[Attempt], Mapping[str, Any] | None]
"""The output of an accepted attempt, where it can still be read."""
_MEMBER = {"probe": "devices", "identify": "devices", "interface": "tools"}


@dataclass(frozen=True, slots=True)
class Pass:
    """One pass. ``number`` is that of its first attempt, ``seconds`` are the agents' own, ``ended`` its last word.

    ``enumerated``, ``annotated``, ``unknown`` (of those) and ``tools`` are what was at its end; None where that is no
    longer known, as are tokens and US dollars that no one reported.
    """

    number: int
    began: str
    ended: str
    stages: tuple[str, ...]
    agents: tuple[str, ...]
    attempts: int
    retries: int
    seconds: float
    enumerated: int | None
    annotated: int | None
    unknown: int | None
    tools: int | None
    input_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None

    @property
    def identified(self) -> int | None:
        """The devices that IDENTIFY has identified on evidence."""
        return None if self.annotated is None or self.unknown is None else self.annotated - self.unknown


def grouped(attempts: Sequence[Attempt]) -> list[list[Attempt]]:
    """The attempts by pass, in their order."""
    groups: list[list[Attempt]] = []
    for item in attempts:
        if not groups or _begins(item, groups[-1]):
            groups.append([])
        groups[-1].append(item)
    return groups


def _begins(item: Attempt, before: Sequence[Attempt]) -> bool:
    last = before[-1]
    if item.stage == last.stage:
        return _turn(item) <= _turn(last)
    returned = RETURNS.get(last.stage) == item.stage and last.state != ACCEPTED
    return STAGES.index(item.stage) < STAGES.index(last.stage) and not returned


def _turn(item: Attempt) -> tuple[int, int]:
    """The place of an attempt among those of its stage: what is reused, the stage's agent, the one after it."""
    role = item.facts.role
    return (0 if role == REUSE else 2 if role == ESCALATE else 1), item.attempt


def passes(groups: Iterable[Sequence[Attempt]], output: Output) -> tuple[Pass, ...]:
    """The cost and result of each pass; a stage that did not run stands as the pass before left it."""
    counts: dict[str, int | None] = dict.fromkeys((*_MEMBER, "unknown"))
    found = []
    for group in groups:
        for item in group:
            value = output(item) if item.stage in _MEMBER and item.state == ACCEPTED else None
            if value is not None and item.facts.role != ESCALATE:
                members = value[_MEMBER[item.stage]]
                counts[item.stage] = len(members)
                if item.stage == "identify":
                    counts["unknown"] = sum(one["category"] == "unknown" for one in members)
        found.append(_pass(group, counts))
    return tuple(found)


def _pass(group: Sequence[Attempt], counts: Mapping[str, int | None]) -> Pass:
    used = [item.facts.usage for item in group]
    asked = [item for item in group if item.facts.role != REUSE]
    return Pass(
        number=group[0].number,
        began=group[0].began,
        ended=group[-1].state,
        stages=tuple(dict.fromkeys(item.stage for item in group)),
        agents=tuple(dict.fromkeys(agent_of(item) for item in group)),
        attempts=len(asked),
        retries=len(asked) - len({(item.stage, item.facts.role) for item in asked}),
        seconds=round(sum(item.facts.seconds for item in group), 3),
        enumerated=counts["probe"],
        annotated=counts["identify"],
        unknown=counts["unknown"],
        tools=counts["interface"],
        input_tokens=known_sum(one.input_tokens for one in used),
        output_tokens=known_sum(one.output_tokens for one in used),
        cost_usd=known_sum(one.cost_usd for one in used),
    )


def known_sum(values: Iterable[Number | None]) -> Number | None:
    """The sum of what is known; None when nothing is."""
    known = [value for value in values if value is not None]
    return sum(known[1:], known[0]) if known else None


def agent_of(item: Attempt) -> str:
    """The agent of an attempt: ``pi, openai/x``, or that an output was reused."""
    if item.facts.role == REUSE:
        return "reused"
    return f"{item.facts.harness}, {item.facts.model}" if item.facts.model else item.facts.harness


def runs(groups: Iterable[Sequence[Attempt]], output: Output) -> list[tuple[Attempt, Run]]:
    """Every accepted IDENTIFY of an agent with the INTERFACE after it, oldest first, each with its last attempt."""
    found: list[tuple[Attempt, Run]] = []
    interface: Mapping[str, Any] | None = None
    rests_on: Mapping[str, Any] | None = None
    for group in groups:
        identify, last = _identified(group, output)
        made = [output(item) for item in group if item.stage == "interface" and item.state == ACCEPTED]
        if identify is not None and identify != rests_on:
            interface, rests_on = None, identify  # tools of another answer are not this one's
        interface = made[-1] if made else interface
        if identify is not None and last is not None:
            found.append((last, run_of(agent_of(last), identify, interface)))
    return found


def _identified(group: Sequence[Attempt], output: Output) -> tuple[Mapping[str, Any] | None, Attempt | None]:
    """The annotations of a pass's own agents, a second one's words in place of the first's."""
    found: Mapping[str, Any] | None = None
    last = None
    for item in group:
        if item.stage != "identify" or item.state != ACCEPTED or item.facts.role == REUSE:
            continue
        value = output(item)
        if value is None:
            continue
        more = item.facts.role == ESCALATE and found is not None
        found, last = (merged(found, value) if more and found is not None else value), item
    return found, last
