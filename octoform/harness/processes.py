"""What /proc says of a process, and signals that cannot hit another one.

A process id alone names nothing: ids are recycled. A process is known by its id together with the tick at which the
kernel started it, and it is signalled through a pidfd that was opened before that was checked. On systems without
/proc nothing can be proved, so every question has the answer None and nothing is signalled.
"""

import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

PROC = Path("/proc")


@dataclass(frozen=True, slots=True)
class Process:
    """A process id with the kernel's start time of it (clock ticks since boot) and its parent's id."""

    pid: int
    start: int
    parent: int = field(compare=False)
    state: str = field(compare=False)


def look(pid: int) -> Process | None:
    """The process with that id as it is now (/proc/<pid>/stat); None when there is none."""
    try:
        text = (PROC / str(pid) / "stat").read_bytes()
    except OSError:
        return None
    fields = text[text.rfind(b")") + 2 :].split()
    return Process(pid, start=int(fields[19]), parent=int(fields[1]), state=fields[0].decode("ascii"))


def is_alive(pid: int, start: int) -> bool:
    """True when exactly that process still runs (a zombie does not)."""
    found = look(pid)
    return found is not None and found.start == start and found.state not in "ZX"


def own() -> Iterator[Process]:
    """Every running process that this user may signal, this one and its parent left out.

    Root may signal all. What a file mode in /proc says is not asked: a process that lets nobody look into it seems to
    be root's (PR_SET_DUMPABLE in prctl(2)).
    """
    spared = {os.getpid(), os.getppid()}
    try:
        entries = list(os.scandir(PROC))
    except OSError:
        return
    for entry in entries:
        if not entry.name.isdigit() or int(entry.name) in spared:
            continue
        found = look(int(entry.name)) if os.getuid() in (0, *_users(entry.name)) else None
        if found is not None and found.state not in "ZX":
            yield found


def _users(pid: str) -> tuple[int, ...]:
    """The real and the saved user of a process (/proc/<pid>/status); none when it is gone."""
    try:
        text = (PROC / pid / "status").read_bytes()
    except OSError:
        return ()
    _, _, line = text.partition(b"\nUid:\t")
    ids = line.partition(b"\n")[0].split()
    return (int(ids[0]), int(ids[2])) if len(ids) == 4 else ()


def kill(process: Process) -> bool:
    """SIGKILL to exactly that process; False when it is gone, is another one by now, or may not be signalled."""
    try:
        handle = os.pidfd_open(process.pid)
    except OSError:
        return False
    try:
        if not is_alive(process.pid, process.start):
            return False
        signal.pidfd_send_signal(handle, signal.SIGKILL)
    except OSError:
        return False
    finally:
        os.close(handle)
    return True
