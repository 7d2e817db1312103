"""Ending what a crash left running: agents of this project whose supervisor and whose octoform are both gone.

Each attempt's folder holds ``process.json``, written before its agent starts: a random mark that is in the
environment and among the limits of every process of the tree, and the supervisor's process id with its start time. A
process is ended only when it bears the very mark that a folder of ours records (or when it descends from such a one),
it belongs to this user and is not older than the attempt. Names and ids alone prove nothing and are never used.
"""

import json
import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from octoform.base import clock, files, processes
from octoform.base.files import read_plain
from octoform.base.place import KEY, is_from, place_of
from octoform.base.processes import PROC, is_alive, process_stat, signal_one
from octoform.harness.containment.agent_environment import ATTEMPT, remove_private
from octoform.harness.containment.reaper import children
from octoform.patterns import regex
from octoform.records import dataclass, field

# The facts in /proc of a process.
#
# A process id alone names nothing: ids are recycled. A process is known by its id together with the tick at which the
# kernel started it. On systems without /proc nothing can be proved, so every question has the answer None and nothing
# is signalled.


@dataclass(frozen=True, slots=True)
class Process:
    """A process id with the kernel's start time of it (clock ticks since boot) and its parent's id."""

    pid: int
    start: int
    parent: int = field(compare=False)
    state: str = field(compare=False)


def look(pid: int) -> Process | None:
    """The process with that id as it is now (/proc/<pid>/stat); None when there is none."""
    found = process_stat(pid, PROC)
    return None if found is None else Process(pid, start=found.start, parent=found.parent, state=found.state)


def own() -> Iterator[Process]:
    """Every running process that this user may signal, this one and its parent omitted.

    Root may signal all. A file mode in /proc is not used: a process that lets no one look into it seems to
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
        signalled = os.getuid() == 0 or os.getuid() in _users(entry.name)
        found = look(int(entry.name)) if signalled else None
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


RECORD = "process.json"
RECORD_LIMIT = 64 << 10
_MARK = regex("[0-9a-f]{32}")
ROUNDS = 100
HUNT_SECONDS, QUIET = 5.0, 20
"""How long what comes without end is hunted, and how many looks at nothing are the end."""


@dataclass(frozen=True, slots=True)
class Adopted:
    """The process that adopts orphans, with the children that it had before."""

    parent: int
    before: frozenset[Process]

    def has(self, process: Process, since: int) -> bool:
        """Whether a process has come to it; ``since`` in clock ticks since boot."""
        return process.parent == self.parent and process.start >= since and process not in self.before


@dataclass(frozen=True, slots=True)
class Record:
    """The content of ``process.json``; ``start`` is the supervisor's start time in clock ticks since boot."""

    mark: str
    pid: int
    start: int
    ended: bool = False

    def is_of(self, pid: int) -> bool:
        """Whether that process bears the attempt's mark."""
        return processes.bears(pid, self.mark, ATTEMPT)


@dataclass(frozen=True, slots=True)
class Swept:
    """The result of a sweep: the processes that it ended, and those that it could not end."""

    ended: tuple[int, ...] = ()
    left: tuple[int, ...] = ()


def write(workdir: Path, record: Record) -> None:
    """Write the record, whole or not at all; OSError when the disk refuses it."""
    value = {
        "format": 1,
        "attempt": record.mark,
        "supervisor": {"pid": record.pid, "start": record.start},
        "ended": record.ended,
        KEY: place_of(workdir),
        "boot": clock.boot_id(),
        "written_at": clock.stamp(),
    }
    files.make_way(workdir / RECORD)
    files.replace(workdir / RECORD, json.dumps(value).encode())


def read(workdir: Path) -> Record | None:
    """The record of an attempt; None when there is none or it is no such thing (an agent may have spoilt it).

    One that was copied along with its folder is of a process of the original's.
    """
    data = read_plain(workdir / RECORD, RECORD_LIMIT)
    try:
        value = files.parse(data or b"")
        supervisor = value["supervisor"]
        record = Record(str(value["attempt"]), int(supervisor["pid"]), int(supervisor["start"]), value["ended"] is True)
    except (ValueError, KeyError, TypeError):
        return None
    return record if _MARK.fullmatch(record.mark) and is_from(value, workdir) else None


def sweep(attempts: Path) -> Swept:
    """End every process of the attempts in that folder, and remove the private folders that a killed run has left.

    Call it only under the lock that forbids a running one.
    """
    try:
        folders = sorted(attempts.iterdir())
    except OSError:
        return Swept()
    found = ((folder, read(folder)) for folder in folders)
    open_records = {folder: record for folder, record in found if record is not None and not record.ended}
    done = end_marked(tuple(open_records.values())) if open_records else Swept()
    for folder in folders:
        remove_private(folder)
    if not done.left:
        for folder, record in open_records.items():
            write(folder, Record(record.mark, record.pid, record.start, ended=True))
    return done


def _hunt(adopted: Adopted, since: int) -> list[int]:
    """SIGKILL to what has come to this process, until nothing comes for a while; the ids of those that it met.

    Only its own children are looked at, so that it is quicker than a process that forks and leaves all the time.
    """
    met: dict[int, bool] = {}
    spared = {process.pid for process in adopted.before}
    quiet, until = 0, time.monotonic() + HUNT_SECONDS
    while quiet < QUIET and time.monotonic() < until:
        quiet += 1
        for pid in children() - spared:
            process = look(pid)
            if process is None or not adopted.has(process, since):
                continue
            if process.state in "ZX":
                with suppress(ChildProcessError):
                    os.waitpid(pid, os.WNOHANG)
                continue
            quiet, met[pid] = 0, signal_one(process.pid, process.start)
    return [pid for pid, ended in met.items() if ended]


def end_marked(records: tuple[Record, ...], adopted: Adopted | None = None) -> Swept:
    """SIGKILL to every process that provably belongs to one of the records, until none is found.

    ``adopted`` identifies those of a supervisor that was killed, whatever they have done with their marks.
    """
    since = min((record.start for record in records if record.start), default=None)
    ended = _hunt(adopted, since) if adopted is not None and since is not None else []
    seen: set[Process] = set()
    for _ in range(ROUNDS):
        found = [process for process in _belonging(records, adopted) if process not in seen]
        if not found:
            break
        for process in found:
            seen.add(process)
            if signal_one(process.pid, process.start):
                ended.append(process.pid)
    _await_end(seen)
    if adopted is not None:
        _collect(seen)
    left = tuple(item.pid for item in seen if is_alive(item.pid, item.start))
    return Swept(tuple(ended), left)


def _collect(killed: set[Process]) -> None:
    """Take note of the end of those that are children of this process, so that they are gone."""
    for process in killed:
        with suppress(ChildProcessError):  # another's child
            os.waitpid(process.pid, os.WNOHANG)


def _belonging(records: tuple[Record, ...], adopted: Adopted | None) -> list[Process]:
    """The tree of each record, its supervisor last: while it lives, its orphans cannot leave the tree."""
    running = {process.pid: process for process in own()}
    since = min((record.start for record in records if record.start), default=None)
    ours: set[int] = set()
    for process in running.values():
        marked = any(process.start >= record.start and record.is_of(process.pid) for record in records)
        if marked or (adopted is not None and since is not None and adopted.has(process, since)):
            ours.add(process.pid)
    size = -1
    while size != len(ours):
        size = len(ours)
        ours |= {process.pid for process in running.values() if process.parent in ours}
    supervisors = {(record.pid, record.start) for record in records}
    return sorted((running[pid] for pid in ours), key=lambda item: (item.pid, item.start) in supervisors)


def _await_end(killed: set[Process], seconds: float = 5.0) -> None:
    """Wait until the kernel has really ended them; a process in an uninterruptible call is given up on."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and any(is_alive(item.pid, item.start) for item in killed):
        time.sleep(0.005)
