"""Whether a host's devices are told to be the same in every run, and the same way usable; pure.

Nobody knows from here whether a name is right. That two runs over the same evidence disagree can be known, and it is
looked for in what the contract holds: the device, what it is, and what it can do. A tool may have another name in
every run; where it serves the same capability of the same device, that is a rename and no disagreement.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

LEFT_OUT = "left out"
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
    """What one run said of one device; ``capabilities`` by name."""

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
    """One thing in which runs differ about a device: ``said`` are the different words, each with how many runs.

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
    """What N runs agree on. ``compared`` devices stand in at least two runs, ``same`` of them alike in all of theirs.

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
    """What the runs agree on."""
    runs, renamed = _aligned(given)
    several = {name: said for name, said in _by_device(runs).items() if len(said) > 1}
    found = [item for name, said in several.items() for item in _differences(name, said)]
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
    return {Ability(device, name) for device, said in run.devices.items() for name in said.capabilities}


def _differences(device: str, said: Sequence[Identity]) -> list[Disagreement]:
    """In what the runs differ; of a device that some left out nothing else is told."""
    left = ["left out" if item.category == LEFT_OUT else "annotated" for item in said]
    if len(set(left)) > 1:
        return [Disagreement(device, "annotated", _counted(left))]
    told = {"identity": [item.identified_as for item in said], "category": [item.category for item in said]}
    found = [Disagreement(device, aspect, _counted(words)) for aspect, words in told.items() if len(set(words)) > 1]
    for name in dict.fromkeys(name for item in said for name in item.capabilities):
        effects = [item.capabilities[name].effect if name in item.capabilities else MISSING for item in said]
        if len(set(effects)) > 1:
            found.append(Disagreement(device, "capability", _counted(effects), name))
    return found


def _counted(words: Sequence[str]) -> tuple[tuple[str, int], ...]:
    return tuple(Counter(words).most_common())


def _aligned(runs: Sequence[Run]) -> tuple[list[Run], tuple[Renamed, ...]]:
    """The runs with one name for what is the same capability, and which tools were called differently."""
    alias = {
        Ability(device, name): best
        for device, said in _by_device(runs).items()
        for best, names in _same_way([item for item in said if item.category != LEFT_OUT])
        for name in names
    }
    aligned = [_renaming(run, alias) for run in runs]
    called: dict[str, dict[str, None]] = {}
    for ability in dict.fromkeys(ability for run in aligned for ability in run.tools):
        names = dict.fromkeys(run.tools[ability] for run in aligned if ability in run.tools)
        if len(names) > 1:
            called.setdefault(ability.capability, {}).update(names)
    return aligned, tuple(Renamed(capability, tuple(names)) for capability, names in sorted(called.items()))


def _same_way(said: Sequence[Identity]) -> list[tuple[str, list[str]]]:
    """Names of one capability, the most frequent and all: in every run it alone has that effect in that way."""
    found = []
    for way in dict.fromkeys(way for item in said for way in item.capabilities.values()):
        in_runs = [[name for name, other in item.capabilities.items() if other == way] for item in said]
        names = [name for several in in_runs for name in several]
        alone = all(len(several) == 1 for several in in_runs)
        elsewhere = any(item.capabilities.get(name, way) != way for item in said for name in names)
        if alone and not elsewhere and len(set(names)) > 1:
            found.append((Counter(names).most_common(1)[0][0], names))
    return found


def _renaming(run: Run, alias: Mapping[Ability, str]) -> Run:
    devices = {
        device: replace(
            said, capabilities={alias.get(Ability(device, name), name): way for name, way in said.capabilities.items()}
        )
        for device, said in run.devices.items()
    }
    tools = {
        ability._replace(capability=alias.get(ability, ability.capability)): name for ability, name in run.tools.items()
    }
    return replace(run, devices=devices, tools=tools)
