"""What a manifest lets the endpoint's tools do, as frozen values: decisions, limits, times. Light.

It speaks of tools by globs, since which tools there will be is only known once INTERFACE is accepted.
"""

from dataclasses import dataclass
from fnmatch import fnmatchcase

MODES = ("enforce", "shadow", "dry_run")
EFFECTS = ("read", "actuate", "irreversible")
DECISIONS = ("allow", "confirm", "deny")
TIMEOUT = "30s"
RESULT_BYTES = 10_000_000


@dataclass(frozen=True, slots=True)
class Rule:
    """``decision`` (``allow``, ``confirm``, ``deny``) for every tool whose name one of the globs matches."""

    tools: tuple[str, ...]
    decision: str

    def matches(self, name: str) -> bool:
        """True for a tool of that name."""
        return any(fnmatchcase(name, glob) for glob in self.tools)


@dataclass(frozen=True, slots=True)
class Limit:
    """What a call of the tools behind the glob ``tool`` must keep to; None where it says nothing.

    The numbers are bounds of the value of ``parameter``: ``step`` of its change from call to call, ``cumulative`` of
    its sum. ``rate`` is a count of calls and the seconds that they are counted in, ``cooldown`` the seconds between
    two calls, ``quiet_hours`` begin and end of the part of the day without calls (``HH:MM``, local time). With
    ``units`` minimum and maximum are of these units of the device alone, and of every tool that moves them.
    """

    tool: str
    parameter: str | None = None
    minimum: float | None = None
    maximum: float | None = None
    step: float | None = None
    cumulative: float | None = None
    rate: tuple[int, float] | None = None
    cooldown: float | None = None
    quiet_hours: tuple[str, str] | None = None
    units: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Policy:
    """Decisions by effect class and by rules (the first that matches decides), limits, seconds and bytes.

    ``timeouts`` are (glob, seconds).
    """

    mode: str = "enforce"
    read: str = "allow"
    actuate: str = "confirm"
    irreversible: str = "confirm"
    rules: tuple[Rule, ...] = ()
    limits: tuple[Limit, ...] = ()
    timeout: float = 30
    timeouts: tuple[tuple[str, float], ...] = ()
    result_bytes: int = RESULT_BYTES

    def decision_for(self, effect: str) -> str:
        """The decision for tools of an effect class that no rule names."""
        return {"read": self.read, "actuate": self.actuate, "irreversible": self.irreversible}[effect]

    def timeout_for(self, name: str) -> float:
        """Seconds that one call of a tool may take.

        A mapping has no order, so of several globs the one that says most decides: a name in full, then the one with
        the most fixed characters; of equal ones the shortest time.
        """
        found = [(_weight(glob), -length) for glob, length in self.timeouts if fnmatchcase(name, glob)]
        return -max(found)[1] if found else self.timeout


def _weight(glob: str) -> tuple[bool, int]:
    fixed = sum(1 for sign in glob if sign not in "*?")
    return fixed == len(glob), fixed
