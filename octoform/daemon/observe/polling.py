"""What stands in for the kernel's word once a user's watches are used up: a look every few seconds. (Light.)"""

from collections.abc import Iterable

from octoform.daemon.model import Cause
from octoform.daemon.observe.inotify import FolderEar
from octoform.diagnostics import Diagnostic, warning

LOOK_SECONDS = 5.0


class Unwatched:
    """An ear for the folders that others could not watch; says nothing while there is none."""

    hold = 0.0

    def __init__(self, ears: Iterable[FolderEar]) -> None:
        self._ears = tuple(ears)

    @property
    def every(self) -> float | None:
        """Seconds between two looks; None while there is nothing to look at."""
        return LOOK_SECONDS if self.folders else None

    @property
    def folders(self) -> int:
        """How many there are now."""
        return sum(len(ear.unwatched) for ear in self._ears)

    def fileno(self) -> int | None:
        """None: nothing wakes it."""
        return None

    def hear(self) -> frozenset[Cause]:
        """Whatever may have happened there since the last look."""
        return frozenset(cause for ear in self._ears for watch in ear.unwatched for cause in watch.causes)

    def close(self) -> None:
        """There is nothing to let go of."""

    def told(self) -> Diagnostic | None:
        """What a person is told of it; None where every folder is watched."""
        if not self.folders:
            return None
        summary = f"{self.folders} folders are looked at every {LOOK_SECONDS:g} s only: the user's watches are used up"
        hint = "sysctl fs.inotify.max_user_watches is their number; a greater one lets the daemon hear at once"
        return warning("DAEMON-FEW-WATCHES", summary, hint=hint)
