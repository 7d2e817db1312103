"""The ledger's settings of the deployment, as plain data: its times, its tools, and what profiles call clean. Light.

The ledger judges an agent's words against facts that no agent wrote, so none of these comes from an agent.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Protocol

from octoform.base.files import read_json
from octoform.claims.model import Condition, Signal, Value, holds
from octoform.conditions import is_number
from octoform.endpoint.expected_tools import promised
from octoform.endpoint.published_files import POLICY, read_policy
from octoform.records import dataclass, field
from octoform.state.layout import Layout

CLAIM_SECONDS = 1800.0
READ = "read"


class Clock(Protocol):
    """Seconds that only rise and go on in suspend (CLOCK_BOOTTIME), and wall time for stamps."""

    def uptime(self) -> float:
        """Seconds since the machine was started."""

    def stamp(self) -> str:
        """RFC 3339 in UTC."""


@dataclass(frozen=True, slots=True)
class ToolFacts:
    """A tool as the endpoint serves it. ``effect`` is ``read``, ``actuate`` or ``irreversible``.

    ``stops`` is set for a tool that stops a movement. ``choices`` are the values that an argument may have, where its
    schema lists them. ``devices`` are ids. ``names_unit_by`` is the argument that names a unit, where it has one.
    """

    effect: str
    stops: bool = False
    devices: tuple[str, ...] = ()
    choices: Mapping[str, tuple[Value, ...]] = field(default_factory=dict)
    names_unit_by: str = ""


@dataclass(frozen=True, slots=True)
class Bound:
    """A profile's bounds of a measured field, the last part of a signal's path.

    Up to ``trouble_above`` (exclusive) a value is clean, and what is above it has settled again below
    ``settled_below``; likewise downwards. None: the profile states nothing on that side. ``sources`` are the tools it
    is about, ``source`` names the profile for a person.
    """

    name: str
    trouble_above: float | None = None
    settled_below: float | None = None
    trouble_below: float | None = None
    settled_above: float | None = None
    sources: tuple[str, ...] = ()
    source: str = "the profile"

    def concerns(self, signal: Signal) -> bool:
        """Whether it is about this signal."""
        named = signal.path.rpartition("/")[2] == self.name
        return signal.channel == "sensor" and named and (not self.sources or signal.source in self.sources)

    def calls_clean(self, condition: Condition, value: Value) -> str | None:
        """Why this condition at this value is within the bounds; None when it is not, or they say nothing of it."""
        if not is_number(value) or not is_number(condition.value):
            return None
        assert isinstance(value, int | float)
        high = self._is_high(value)
        if not high and not self._is_low(value):
            return f"{value:g} is on the clean side of {self.source}"
        trouble, settled = (
            (self.trouble_above, self.settled_below) if high else (self.trouble_below, self.settled_above)
        )
        over = settled if settled is not None else trouble
        assert over is not None
        if holds(condition, math.nextafter(over, -math.inf if high else math.inf)) is not True:
            return None
        return f"it would still hold {'below' if high else 'above'} {over:g}, where {self.source} calls it over"

    def _is_low(self, value: float) -> bool:
        return self.trouble_below is not None and value <= self.trouble_below

    def _is_high(self, value: float) -> bool:
        return self.trouble_above is not None and value >= self.trouble_above

    def is_problem(self, value: Value) -> bool:
        """Whether the profile itself calls this value a problem."""
        if not is_number(value) or value is None or isinstance(value, str):
            return False
        return self._is_low(value) or self._is_high(value)


def _open() -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Settings:
    """``claim_seconds`` is the longest that a claim holds without new evidence, and how fresh evidence has to be.

    ``tools`` by name; a claim can restrict only what is there. ``bounds`` are the profiles'. ``boot`` distinguishes one
    start of the machine from the next; empty: ask the kernel. ``shut`` is asked when another process has changed
    the ledger: True while none may, since an agent is at work; then what this process knows is written again.
    """

    claim_seconds: float = CLAIM_SECONDS
    tools: Mapping[str, ToolFacts] = field(default_factory=dict)
    bounds: tuple[Bound, ...] = ()
    boot: str = ""
    shut: Callable[[], bool] = _open

    def devices_of(self, tool: str) -> frozenset[str]:
        """The ids of a tool's devices."""
        facts = self.tools.get(tool)
        return frozenset(facts.devices) if facts is not None else frozenset()

    def bounds_of(self, signal: Signal) -> tuple[Bound, ...]:
        """The bounds that are about a signal."""
        return tuple(bound for bound in self.bounds if bound.concerns(signal))


# What the ledger has to know of a deployment, gathered from what octoform itself wrote and what profiles say. Light.
#
# Tools come from the accepted interface and the published policy. Profiles are prose with front matter, too heavy for
# the daemon: what they call clean is made into plain values once (`bound_documents`, in the daemon's child) and comes
# back from there (`bounds_of`).


class Protects(Protocol):
    """A field that no unit may exceed: it is moved no more from ``refuse_at`` on, and again below ``resume_below``."""

    @property
    def field(self) -> str:
        """The name of the field in a tool's result."""

    @property
    def refuse_at(self) -> float:
        """Where a problem begins."""

    @property
    def resume_below(self) -> float:
        """Where it is over."""


def settings_of(layout: Layout, claim_seconds: float, bounds: Iterable[Mapping[str, Any]] = ()) -> Settings:
    """The ledger's settings for a host; ``bounds`` are those of `bound_documents`. Its tools are the present ones."""
    return Settings(claim_seconds=claim_seconds, tools=ServedTools(layout), bounds=bounds_of(bounds))


class ServedTools(Mapping[str, ToolFacts]):
    """`tools_of` a host, read again once the endpoint was published again."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._seen: tuple[tuple[int, int, int] | None, ...] = ()
        self._tools: dict[str, ToolFacts] = {}

    def _now(self) -> dict[str, ToolFacts]:
        seen = _stamp(self._layout.endpoint / POLICY), _stamp(self._layout.output("interface"))
        if seen != self._seen:
            self._seen, self._tools = seen, tools_of(self._layout)
        return self._tools

    def __getitem__(self, name: str) -> ToolFacts:
        return self._now()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._now())

    def __len__(self) -> int:
        return len(self._now())


def tools_of(layout: Layout) -> dict[str, ToolFacts]:
    """The tools that the endpoint serves, by name; none where interface or policy cannot be read."""
    try:
        policies = (read_policy(layout) or {"tools": {}})["tools"]
        return {
            name: _facts(tool, policies[name])
            for name, tool in promised(layout).items()
            if isinstance(policies.get(name), Mapping)
        }
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def bound_documents(layout: Layout, protects: Iterable[tuple[str, Protects]]) -> list[dict[str, Any]]:
    """The clean values by the profiles (name, protection of its units), as plain values, for their devices' tools."""
    found = []
    for name, each in protects:
        devices = _devices(layout, name)
        tools = sorted(tool for tool, facts in promised(layout).items() if devices & set(facts.get("devices") or ()))
        if tools:
            fields = {"name": each.field, "trouble_above": each.refuse_at, "settled_below": each.resume_below}
            found.append({**fields, "sources": tools, "source": f"the profile {name}"})
    return found


def bounds_of(documents: Iterable[Mapping[str, Any]]) -> tuple[Bound, ...]:
    """The bounds in plain values; what is none is omitted, which refuses less and never more."""
    found = []
    for each in documents:
        numbers = {name: each.get(name) for name in _NUMBERS}
        if isinstance(each.get("name"), str) and all(one is None or is_number(one) for one in numbers.values()):
            sources = tuple(str(source) for source in each.get("sources") or ())
            found.append(Bound(str(each["name"]), **numbers, sources=sources, source=str(each.get("source"))))
    return tuple(found)


_NUMBERS = ("trouble_above", "settled_below", "trouble_below", "settled_above")


def _facts(tool: Mapping[str, Any], policy: Mapping[str, Any]) -> ToolFacts:
    properties = (tool.get("input_schema") or {}).get("properties") or {}
    choices = {name: tuple(each["enum"]) for name, each in properties.items() if isinstance(each.get("enum"), list)}
    named = str((tool.get("units") or {}).get("parameter") or "")
    return ToolFacts(str(tool["effect"]), bool(policy.get("stops")), tuple(tool.get("devices") or ()), choices, named)


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns, status.st_size


def _devices(layout: Layout, profile: str) -> set[str]:
    """The devices to whose meaning a profile contributed."""
    try:
        devices = read_json(layout.output("identify"))["devices"]
        return {str(each["id"]) for each in devices if each.get("profile") == profile}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return set()
