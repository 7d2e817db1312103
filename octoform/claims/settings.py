"""What the ledger is told of the deployment, as plain data: its times, its tools, and what profiles call clean. Light.

The ledger judges an agent's words against facts that no agent wrote, so none of these comes from an agent.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

from octoform.claims.conditions import holds
from octoform.claims.model import Condition, Signal, Value
from octoform.conditions import is_number

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
    """What a profile says of a measured field, the last part of a signal's path.

    Up to ``trouble_above`` (exclusive) a value is clean, and what is above it has settled again below
    ``settled_below``; likewise downwards. None: the profile says nothing on that side. ``sources`` are the tools it
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

    def says_trouble(self, value: Value) -> bool:
        """Whether the profile itself calls this value trouble."""
        if not is_number(value) or value is None or isinstance(value, str):
            return False
        return self._is_low(value) or self._is_high(value)


def _open() -> bool:
    return False


@dataclass(frozen=True, slots=True)
class Settings:
    """``claim_seconds`` is the longest that a claim holds without new evidence, and how fresh evidence has to be.

    ``tools`` by name; a claim can restrict only what stands there. ``bounds`` are the profiles'. ``boot`` tells one
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
