"""One lock for each host's state, which a dead holder cannot keep and a live one cannot lose.

The lock is a file that states who holds it, so that a refusal can name the process, and a `force-unlock` can name the
lock. Anyone who looks at it, takes it or clears it does so under a kernel lock on a guard file, so two processes that
both find a dead holder cannot both clear it (the second would clear the first one's new lock). The holder also keeps a
kernel lock on the file itself: it proves life across containers. Light.
"""

import contextlib
import errno
import os
import time
import uuid
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from types import TracebackType

from octoform.base import digest, locks
from octoform.base.clock import boot_id, stamp
from octoform.base.files import parse, publish, publish_new, read, sync_folder, write_all
from octoform.base.place import KEY, is_from, place_of
from octoform.base.processes import PROC, start_of
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass
from octoform.state.files import display, make_folders, read_regular, refused
from octoform.state.layout import Layout

# Who holds a lock, and whether that process still lives.
#
# A pid alone is no identity: it is given again, and it means another process after a reboot, on another machine or in
# another container. So a holder is pid, start time, boot, machine and pid namespace, as the kernel reports them. Light.

_MACHINE_ID = Path("/etc/machine-id")


class Liveness(StrEnum):
    """The knowledge about a lock's holder from here."""

    ALIVE = "alive"
    DEAD = "dead"
    ELSEWHERE = "elsewhere"
    HIDDEN = "hidden"


@dataclass(frozen=True, slots=True)
class Process:
    """One process of one boot of one machine.

    ``start_time`` is field 22 of ``/proc/<pid>/stat`` (clock ticks since boot; None where there is no /proc),
    ``machine`` a digest of the machine id, ``namespace`` the pid namespace, ``host`` the node name.
    """

    pid: int
    start_time: int | None
    boot_id: str
    machine: str
    namespace: str
    host: str


def myself(proc: Path = PROC) -> Process:
    """The calling process."""
    pid = os.getpid()
    found = start_of(pid, proc)
    return Process(
        pid=pid,
        start_time=found,
        boot_id=boot_id(proc),
        machine=digest.short(digest.of_bytes(_text(_MACHINE_ID).encode())),
        namespace=_link(proc / "self/ns/pid"),
        host=os.uname().nodename,
    )


def liveness(holder: Process, me: Process, proc: Path = PROC) -> Liveness:
    """Whether ``holder`` lives, as far as ``me`` can know.

    ELSEWHERE: on another machine. HIDDEN: on this one, but in another pid namespace (a container), or where no boot
    id is reported.
    """
    if holder.boot_id != me.boot_id:
        return Liveness.DEAD if _same_machine(holder, me) and holder.boot_id and me.boot_id else Liveness.ELSEWHERE
    if me.boot_id == "":
        return Liveness.HIDDEN if _same_machine(holder, me) else Liveness.ELSEWHERE
    if holder.namespace != me.namespace:
        return Liveness.HIDDEN
    return Liveness.ALIVE if start_of(holder.pid, proc) == holder.start_time is not None else Liveness.DEAD


def _same_machine(one: Process, other: Process) -> bool:
    return one.machine == other.machine and one.host == other.host


def to_json(process: Process) -> dict[str, object]:
    """The JSON object of a process."""
    return asdict(process)


def from_json(document: Mapping[str, object]) -> Process:
    """The process in a JSON object; ValueError when it is none."""
    pid, began = document.get("pid"), document.get("start_time")
    texts = [document.get(name) for name in ("boot_id", "machine", "namespace", "host")]
    if not isinstance(pid, int) or not isinstance(began, int | None) or not all(isinstance(t, str) for t in texts):
        raise ValueError("no process")
    boot_id, machine, namespace, host = (str(text) for text in texts)
    return Process(pid, began, boot_id, machine, namespace, host)


def _text(path: Path) -> str:
    with contextlib.suppress(OSError):
        return read(path, 4096).decode("utf-8", "replace").strip()
    return ""


def _link(path: Path) -> str:
    with contextlib.suppress(OSError):
        return str(path.readlink())
    return ""


_LIMIT = 64 * 1024
_GUARD_SECONDS = 5.0
_FIRST_PAUSE, _MAX_PAUSE = 0.1, 2.0


@dataclass(frozen=True, slots=True)
class Holder:
    """The content of the lock file: its id, its holder, the operation, since when (RFC 3339), in which folder."""

    id: str
    process: Process
    operation: str
    created: str
    place: object = None


@dataclass(frozen=True, slots=True)
class Waiting:
    """How long to wait for a lock (seconds), and on which clock; ``notify`` is called once when waiting starts."""

    timeout: float = 0.0
    clock: Callable[[], float] = time.monotonic
    sleep: Callable[[float], None] = time.sleep
    notify: Callable[[Holder], None] | None = None


class Lock:
    """A held lock. Use as a context manager, or call `release`."""

    def __init__(self, layout: Layout, holder: Holder, descriptor: int) -> None:
        """``descriptor`` is open on the lock file and carries the kernel lock that proves life."""
        self._layout = layout
        self._descriptor: int | None = descriptor
        self.holder = holder

    def held(self) -> bool:
        """Whether the lock is still ours: no one forced it."""
        there = read_holder(self._layout)
        return self._descriptor is not None and isinstance(there, Holder) and there.id == self.holder.id

    def release(self) -> None:
        """Give the lock back; a lock that was forced and taken by another is left alone."""
        if self._descriptor is None:
            return
        # A lock file that cannot be removed clears itself: its holder will be gone.
        with contextlib.suppress(OSError), _guard(self._layout, Waiting(_GUARD_SECONDS)):
            if self.held():
                self._layout.lock.unlink(missing_ok=True)
        os.close(self._descriptor)
        self._descriptor = None

    def __enter__(self) -> "Lock":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.release()


@dataclass(frozen=True, slots=True)
class Acquired:
    """The lock or why not; ``notices`` are sentences for the person (a dead holder's lock was cleared)."""

    lock: Lock | None
    diagnostics: tuple[Diagnostic, ...] = ()
    notices: tuple[str, ...] = ()


def read_holder(layout: Layout) -> Holder | Diagnostic | None:
    """The holder of the lock; None when there is none; STATE-LOCK-UNREADABLE when the file is no lock."""
    data, problem = read_regular(layout.lock, _LIMIT)
    if problem is not None:
        return problem
    if data is None:
        return None
    try:
        document = parse(data)
        process = from_json(document)
        operation, created = str(document["operation"]), str(document["created"])
        return Holder(str(document["id"]), process, operation, created, document.get(KEY))
    except (ValueError, KeyError, TypeError, AttributeError):
        return error(
            "STATE-LOCK-UNREADABLE",
            "the lock file is not one that octoform wrote",
            path=display(layout.lock),
            hint="check that no octoform runs on this host's state, then remove the file",
        )


def acquire(layout: Layout, operation: str, waiting: Waiting | None = None, proc: Path = PROC) -> Acquired:
    """Take the lock of a host's state for ``operation`` (``apply``); a live holder's lock is waited for, never broken.

    STATE-LOCKED names holder, operation and since when. Folders are made as needed.
    """
    patience = waiting or Waiting()
    problem = make_folders(layout)
    if problem is not None:
        return Acquired(None, (problem,))
    deadline = patience.clock() + patience.timeout
    pause, found = _FIRST_PAUSE, False
    while True:
        outcome = _try(layout, operation, proc)
        left = deadline - patience.clock()
        if not isinstance(outcome, Holder) or left <= 0:
            break
        if patience.notify is not None and not found:
            patience.notify(outcome)
            found = True
        patience.sleep(min(pause, left))
        pause = min(pause * 2, _MAX_PAUSE)
    if isinstance(outcome, Holder):
        return Acquired(None, (_locked(layout, outcome, myself(proc), proc),))
    return outcome


def _try(layout: Layout, operation: str, proc: Path) -> Acquired | Holder:
    """One attempt: the lock, a diagnostic that waiting will not cure, or the live holder."""
    try:
        with _guard(layout, Waiting(_GUARD_SECONDS)):
            there = read_holder(layout)
            if isinstance(there, Diagnostic):
                return Acquired(None, (there,))
            notices: tuple[str, ...] = ()
            if there is not None:
                if not is_dead(layout, there, proc):
                    return there
                layout.lock.unlink()
                notices = (_cleared(there),)
            return Acquired(_create(layout, operation, proc), (), notices)
    except OSError as problem:
        return Acquired(None, (refused(problem, layout.lock),))


def is_dead(layout: Layout, holder: Holder, proc: Path = PROC) -> bool:
    """True for a holder that is gone for certain; OSError when the lock cannot be looked at any more.

    One that lives on this machine and has locked another folder, of which this one is a copy, never had this one.
    """
    verdict = liveness(holder.process, myself(proc), proc)
    if verdict is Liveness.ALIVE and holder.place is not None:
        return not is_from({KEY: holder.place, "boot": holder.process.boot_id}, layout.local)
    return verdict is Liveness.DEAD or (verdict is Liveness.HIDDEN and not locks.is_locked(layout.lock))


def is_locked(layout: Layout) -> bool:
    """Whether a run that lives holds the lock."""
    try:
        return locks.is_locked(layout.lock)
    except OSError:
        return False


def _create(layout: Layout, operation: str, proc: Path) -> Lock:
    """Write the lock file whole and already locked, then give it its name; OSError when the disk refuses."""
    created = stamp()
    holder = Holder(str(uuid.uuid4()), myself(proc), operation, created)
    document = {"id": holder.id, **to_json(holder.process), "operation": operation, "created": created}
    document[KEY] = place_of(layout.local)
    draft = layout.lock.with_name(f".{layout.lock.name}.{holder.id}")
    descriptor = os.open(draft, os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    try:
        locks.acquire(descriptor)
        write_all(descriptor, digest.canonical_json(document) + b"\n")
        os.fsync(descriptor)
        _name(draft, layout.lock)
        sync_folder(layout.lock.parent)
    except OSError:
        os.close(descriptor)
        raise
    finally:
        draft.unlink(missing_ok=True)
    return Lock(layout, holder, descriptor)


def _name(draft: Path, path: Path) -> None:
    """Give the draft its name only if that is free; where the file system has no links the guard alone sees to that."""
    try:
        publish_new(draft, path)
    except OSError as problem:
        if problem.errno not in (errno.EPERM, errno.EOPNOTSUPP, errno.ENOSYS):
            raise
        publish(draft, path)


@contextlib.contextmanager
def _guard(layout: Layout, waiting: Waiting) -> Iterator[None]:
    """Hold the guard file's kernel lock for the moment it takes to look at the lock and change it.

    TimeoutError (an OSError) when another process keeps it, which only one that was stopped in that moment can.
    """
    descriptor = locks.lock_file(layout.lock.with_name("lock.guard"))
    try:
        if not locks.acquire(descriptor, waiting.timeout, clock=waiting.clock, sleep=waiting.sleep):
            raise TimeoutError(None, "another octoform keeps its guard file locked")
        yield
    finally:
        os.close(descriptor)


def _cleared(holder: Holder) -> str:
    return (
        f"cleared the lock of a process that is gone (pid {holder.process.pid} on {holder.process.host}, "
        f"{holder.operation} since {holder.created})"
    )


def _locked(layout: Layout, holder: Holder, me: Process, proc: Path) -> Diagnostic:
    who = f"pid {holder.process.pid} on {holder.process.host}"
    verdict = liveness(holder.process, me, proc)
    if verdict is Liveness.ELSEWHERE:
        summary = f"the state of {layout.host} is locked from another machine: {holder.operation} by {who}"
        hint = f"if nothing runs there any more: octoform force-unlock {holder.id}"
    else:
        summary = f"the state of {layout.host} is locked: {holder.operation} by {who}"
        hint = "wait for it to end (apply and destroy do, with -lock-timeout); it is alive, so its lock is not cleared"
    detail = f"lock {holder.id}, held since {holder.created}"
    return error("STATE-LOCKED", summary, path=display(layout.lock), detail=detail, hint=hint)


def force_unlock(layout: Layout, lock_id: str) -> list[Diagnostic]:
    """Remove the lock of that id, no matter who holds it; the id proves that the person read who does."""
    try:
        with _guard(layout, Waiting(_GUARD_SECONDS)):
            there = read_holder(layout)
            if isinstance(there, Diagnostic):
                return [there]
            if there is None:
                return [
                    error("STATE-NOT-LOCKED", f"the state of {layout.host} is not locked", path=display(layout.lock))
                ]
            if there.id != lock_id:
                detail = f"{there.operation} by pid {there.process.pid} on {there.process.host} since {there.created}"
                hint = f"octoform force-unlock {there.id}"
                summary = f"the lock that is there is not {lock_id!r}"
                return [error("STATE-LOCK-ID", summary, path=display(layout.lock), detail=detail, hint=hint)]
            layout.lock.unlink()
    except FileNotFoundError:
        return [error("STATE-NOT-LOCKED", f"the state of {layout.host} is not locked", path=display(layout.lock))]
    except OSError as problem:
        return [refused(problem, layout.lock)]
    return []
