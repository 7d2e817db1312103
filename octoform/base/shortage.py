"""A system that gives no more processes or threads: one form for a refused fork and for a refused thread.

The kernel counts both against the same limits: that of the user (``ulimit -u``) and those of the control groups
(``pids.max``). A refused fork is an OSError in Python, a refused thread a RuntimeError. Standard library only.
"""

import errno
import os
import threading
from pathlib import Path

from octoform.base.files import head

TEXT = "no more processes or threads can be started"
_WORDS = (os.strerror(errno.EAGAIN), "can't start new thread", TEXT)
"""The messages of programs about a shortage."""


def start(thread: threading.Thread) -> None:
    """Start a thread; BlockingIOError (EAGAIN), as of a fork, when the system gives none."""
    try:
        thread.start()
    except RuntimeError:
        raise BlockingIOError(errno.EAGAIN, TEXT) from None


def require(threads: int) -> None:
    """BlockingIOError when a process with so many threads cannot be started; asked before one that works is ended."""
    over = threading.Event()
    begun: list[threading.Thread] = []
    try:
        for _ in range(threads):
            thread = threading.Thread(target=over.wait, daemon=True)
            start(thread)
            begun.append(thread)
    finally:
        over.set()
        for thread in begun:
            thread.join()


def is_shortage(problem: BaseException) -> bool:
    """Whether this is a refused fork or thread. A refused file lock is no exception that leaves its caller."""
    return isinstance(problem, OSError) and problem.errno == errno.EAGAIN and problem.filename is None


def printed(text: str) -> bool:
    """Whether a program that failed has printed that it got no process or thread."""
    return any(words in text for words in _WORDS)


def limits() -> str:
    """The limits in force, as far as they can be read: ``ulimit -u is 64, pids.max is 100``."""
    import resource  # most who are here only start a thread

    soft, _ = resource.getrlimit(resource.RLIMIT_NPROC)
    found = [] if soft == resource.RLIM_INFINITY else [f"ulimit -u is {soft}"]
    room, _ = resource.getrlimit(resource.RLIMIT_AS)  # a thread needs room for its stack
    found += [] if room == resource.RLIM_INFINITY else [f"ulimit -v is {room // 1024}"]
    most = _pids_max()
    found += [f"pids.max of {most[0]} is {most[1]}"] if most is not None else []
    return ", ".join(found)


def _pids_max() -> tuple[str, int] | None:
    """The control group with the smallest bound on processes, and that bound (cgroups(7), version 2)."""
    try:
        own = Path("/proc/self/cgroup").read_text("utf-8", "replace").splitlines()
    except OSError:
        return None
    name = next((line[3:] for line in own if line.startswith("0::/")), None)
    if name is None:
        return None
    top = Path("/sys/fs/cgroup")
    group = top / name.lstrip("/")
    found = []
    for place in (group, *group.parents):
        if place.is_relative_to(top):
            try:
                found.append((str(place), int(head(place / "pids.max", 32))))
            except (OSError, ValueError):  # the topmost group has none, and ``max`` is no bound
                continue
    return min(found, key=lambda item: item[1], default=None)
