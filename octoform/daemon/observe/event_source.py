"""What all ears of the daemon have in common. (Light.)"""

from typing import Protocol

from octoform.daemon.model import Cause


class Ear(Protocol):
    """Listens to one thing."""

    @property
    def hold(self) -> float:
        """Seconds for which it is left alone after it was heard: what happens all the time then costs little.

        What it has to say waits in the kernel meanwhile.
        """

    @property
    def every(self) -> float | None:
        """None for an ear that the kernel wakes, else the seconds between two looks of one that has to look."""

    def fileno(self) -> int | None:
        """The descriptor that becomes readable; None while there is nothing to listen to."""

    def hear(self) -> frozenset[Cause]:
        """What happened since the last time; empty when it was nothing of interest."""

    def close(self) -> None:
        """Let go of it."""
