"""What the kernel tells of a process in one line (proc(5), ``/proc/PID/stat``).

A process id alone names nothing: ids are recycled. A process is known by its id together with the tick at which the
kernel started it.
"""

from pathlib import Path
from typing import NamedTuple

PROC = Path("/proc")


class ProcessStat(NamedTuple):
    """State (one letter), ids of parent and group, number of threads, start in clock ticks since boot."""

    state: str
    parent: int
    group: int
    threads: int
    start: int

    @property
    def is_over(self) -> bool:
        """Whether it has ended, and only its parent has not asked for its status yet (a zombie)."""
        return self.state in "ZX"

    @property
    def is_stopped(self) -> bool:
        """Whether it stands still because a signal or a debugger told it to."""
        return self.state in "Tt"


def process_stat(pid: int, proc: Path = PROC) -> ProcessStat | None:
    """What there is of a process now; None when there is none, or where there is no /proc."""
    try:
        text = (proc / str(pid) / "stat").read_text(errors="replace")
        # The command name stands in parentheses and may hold anything, parentheses and blanks too.
        fields = text[text.rindex(")") + 2 :].split()
        return ProcessStat(fields[0], int(fields[1]), int(fields[2]), int(fields[17]), int(fields[19]))
    except (OSError, ValueError, IndexError):
        return None
