"""What a case of the campaign is, and what came of one injection; values only."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from octoform.daemon.model import Kind, Repair

if TYPE_CHECKING:
    from campaign.bench import Bench

REPAIRED, WAITS, SURFACED, QUIET = "repaired", "waits", "escalated", "quiet"
"""How a case has to end: repaired by the daemon; by the world (the case); reported to a person; or nothing to do."""


@dataclass(frozen=True)
class Case:
    """A fault as data.

    ``inject`` makes it, ``right`` checks from outside that all is well again, ``mend`` is what the world or a person
    does where the daemon must not. ``kinds`` are the findings that count as detected (none for a case that must stay
    quiet), ``repairs`` those that are right: every other one is wrong. ``detect`` and ``repair`` are targets in
    seconds, from the injection on. ``may_change`` are paths below the project that the right repair changes; all else
    that was accepted or published must have the same bytes afterwards. ``rows`` are those of the list of known faults.
    ``calls`` is how many agent calls the case may cost. ``after`` lists what else is not as it has to be at the end.
    ``spoils``: another server is served afterwards, so the next case has a bench of its own. ``untold`` is how many
    runs of agents that are not counted, because their counter was killed.
    ``unwritten``: the daemon can write nothing down meanwhile, so what it prints counts.
    """

    name: str
    inject: Callable[["Bench"], None]
    kinds: frozenset[Kind] = frozenset()
    repairs: frozenset[Repair] = frozenset()
    ends: str = REPAIRED
    right: "Callable[[Bench], bool] | None" = None
    mend: "Callable[[Bench], object] | None" = None
    detect: float = 3.0
    repair: float = 15.0
    may_change: tuple[str, ...] = ()
    rows: str = ""
    calls: int = 0
    bench: str = "scripted"
    hold: float = 1.5
    after: Callable[["Bench"], list[str]] | None = None
    spoils: bool = False
    untold: int = 0
    unwritten: bool = False


@dataclass
class Result:
    """One injection: seconds from it until it was noticed, and until all was well as seen from outside."""

    case: str
    detected: float | None = None
    repaired: float | None = None
    wrong: list[str] = field(default_factory=list)
    missed: list[str] = field(default_factory=list)
    slow: list[str] = field(default_factory=list)
    """Targets of time that were missed; on a machine with other work they prove little."""
    calls: int = 0
    tokens: int = 0
    survivors: int = 0
    repairs: list[str] = field(default_factory=list)
    load: float | None = None
    """Processes that wanted a core in the minute before its end."""
