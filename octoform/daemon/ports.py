"""What the daemon's loop asks of the world, by role: tests put their own behind each, the composition the real ones."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from octoform.claims.model import Reading, Signal
from octoform.daemon.model import Alert, Cause, Done, Facts, Finding, Repair


class Clock(Protocol):
    """Time: seconds that only rise and go on while the machine sleeps (CLOCK_BOOTTIME), and wall time for stamps."""

    def uptime(self) -> float:
        """Seconds since the machine was started."""

    def stamp(self) -> str:
        """RFC 3339 in UTC."""


class Sources(Protocol):
    """Where events come from."""

    def wait(self, seconds: float | None) -> frozenset[Cause]:
        """Wait for events, at most so long; empty when the time is over. A burst of them comes as one."""

    def rouse(self) -> None:
        """Let a wait return now, or the next one; may be called by another thread or a signal's handler."""

    def follow(self, facts: Facts) -> None:
        """Listen to what these facts name: the process that runs now, the files that are there."""

    def close(self) -> None:
        """Let go of everything."""


class Look(Protocol):
    """Looks at the deployment; cheap, and only as far as ``causes`` make it worth while."""

    def __call__(self, causes: frozenset[Cause]) -> Facts:
        """The facts; what is not looked at for these causes is as it was at the last look."""


class Repairer(Protocol):
    """Carries out one repair; blocking, bounded in time, and never raises for what the world does."""

    def __call__(self, finding: Finding, repair: Repair, /) -> Done:
        """Do it once."""


Sample = Callable[[], Iterable[Reading]]
"""Fresh readings of one channel; what cannot be read is a reading of ``None``, never left out."""
Promised = Callable[[], frozenset[Signal]]
"""What ought to report: each reading tool, and the camera where it may be looked through; without a path."""
Notify = Callable[[Alert], None]


@dataclass(frozen=True, slots=True)
class Ports:
    """Everything that the loop needs of the world."""

    clock: Clock
    sources: Sources
    look: Look
    repair: Repairer
    sample: Sample
    promised: Promised
    notify: Notify
