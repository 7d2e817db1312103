"""Start and stop the process that serves a host's endpoint. Light until something is really started.

It is started detached, from the launcher that apply wrote, or by systemd where a person had that installed. Only what
is proved to be that process is ever signalled (`signal_one`), so that a recycled pid is never hit.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Protocol

from octoform.base import processes
from octoform.base.files import private_folder, read
from octoform.base.locks import held
from octoform.base.processes import process_stat, signal_one
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process import systemd
from octoform.endpoint.process.record import MARK, Running, is_it, last_running, running
from octoform.endpoint.published_files import LAUNCHER, not_ours, of_another
from octoform.endpoint.sockets import greeted
from octoform.records import dataclass, replace
from octoform.state.layout import Layout

START_SECONDS = 120.0
"""For a start on a small board; a second or two elsewhere. One that has ended is seen at once."""
STOP_SECONDS = 8.0
"""Seconds for a graceful end before a firm one, and how long a start waits for the end of the process before it."""
TAKEN = 75
"""Exit status of a process that found the endpoint owned by another one (EX_TEMPFAIL)."""
LARGE_LOG = 10_000_000
"""Bytes of the process's own log above which a start begins a new one."""
PASSED = ("HOME", "PATH", "LANG", "LC_ALL", "TMPDIR", "TZ", "USER", "LOGNAME", "XDG_RUNTIME_DIR")
"""Variables that the process gets of anyone who starts it: no secrets, and the same from every place."""
ROOM_BYTES = 256 * 1024
"""Bytes that a start writes at most before it serves: records, the first lines of its logs, and some to spare."""
START_THREADS = 8
"""Threads of a process that serves, before the first call."""
PUBLISHED_BYTES = 4 * 1024 * 1024
"""Bytes that publishing an endpoint takes, copies included."""
KEPT_CHILD = "runtime-child"
_STEP = 0.02
_SHARE = 0.05
"""Of the time since a start began, the share until the next look: a slow host is not looked at more often."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """How the process ended: ``firmly`` when it had to be killed. ``process`` is None when none ran."""

    process: Running | None
    firmly: bool = False


def start(layout: Layout, seconds: float = START_SECONDS) -> tuple[Running | None, Diagnostic | None]:
    """The running process, started unless it runs; the reason when it does not come up within ``seconds``.

    Several starts at once make one process.
    """
    if not (layout.endpoint / LAUNCHER).is_file():
        hint = "run octoform apply, which builds it"
        return None, error("ENDPOINT-NOT-APPLIED", f"{layout.host} has no endpoint yet", hint=hint)
    if copied := of_another(layout):
        found = running(layout)  # a renamed folder keeps what was started from it
        return (found, None) if found is not None and accepts(layout) else (None, copied)
    for folder in (layout.run, layout.logs):
        if foreign := not_ours(folder):
            return None, error("ENDPOINT-START-FAILED", "the endpoint is not started", detail=foreign)
    with _turn(layout):
        end = time.monotonic() + seconds
        found = running(layout)
        if found is not None:
            if accepts(layout):
                return found, None
            _gone(found, min(end, time.monotonic() + STOP_SECONDS))  # a process that accepts no connection is ending
        return _start(layout, end)


def obstacle(layout: Layout, size: int = ROOM_BYTES) -> Diagnostic | None:
    """Why a start would fail (no room, no threads); asked before an endpoint that is well is ended for another."""
    from octoform.base.files import require_room  # here, so that a client's pipe does not load them
    from octoform.base.shortage import require
    from octoform.state.files import refused, unforeseen_refusal

    try:
        require(START_THREADS)
    except BlockingIOError as problem:
        return _left(unforeseen_refusal(problem))
    devices: set[int] = set()
    for folder in (layout.endpoint, layout.run, layout.logs):
        try:
            device = private_folder(folder).stat().st_dev
            require_room(folder, 1 if device in devices else size)  # one file system has its room once
            devices.add(device)
        except OSError as problem:
            return _left(refused(problem, folder))
    return None


def _left(found: Diagnostic) -> Diagnostic:
    return replace(found, detail="; ".join(filter(None, (found.detail, "the endpoint was left as it is"))))


def accepts(layout: Layout) -> bool:
    """True when something takes clients at the endpoint's socket, be it slowly."""
    return _takes_clients(os.fspath(layout.socket))


def _takes_clients(socket: str) -> bool:
    try:
        greeted(socket, 1.0).close()
    except BlockingIOError:  # so many wait there already
        return True
    except OSError:
        return False
    return True


def stop(layout: Layout, seconds: float = STOP_SECONDS) -> Stopped:
    """End the process: asked first, killed when it has not gone after ``seconds``; nothing else is ever touched.

    One that a signal or a debugger has stopped is killed at once: it hears nothing, and were it woken, calls that
    waited still for who knows how long would go on first. (Systemd has its own way, and starts again what somebody else
    ends.)
    """
    found = running(layout)
    if found is None:
        if (former := last_running(layout)) is not None:
            clear_left(former)
        return Stopped(None)
    if not systemd.stopped(layout):
        signal_one(found.pid, found.start, signal.SIGTERM)
    firmly = is_stopped(found.pid) or not _gone(found, time.monotonic() + seconds)
    if firmly:
        signal_one(found.pid, found.start)
        _gone(found, time.monotonic() + seconds)
    clear_left(found)
    return Stopped(found, firmly)


def clear_left(process: Running, *, spare: bool = False) -> int:
    """End what the tools of an endpoint left running, and with ``spare`` not the endpoint; how many there were.

    The children of the runtime, which it keeps for the next call and which end by themselves, are a part of it.
    """
    from octoform.endpoint.bounded_program import clear  # here, so that a client's pipe does not load it

    spared = {process.pid, *_kept_children(process.pid)} if spare else ()
    return clear(process.mark, MARK, spared=spared) if process.mark else 0


def _kept_children(pid: int) -> list[int]:
    """The children of a process that have the name of those that the runtime keeps (`octoform.runtime.child`)."""
    found = []
    for listed in Path(f"/proc/{pid}/task").glob("*/children"):
        with suppress(OSError):  # a thread, or a child, that has ended meanwhile
            pids = [int(each) for each in read(listed).split()]
            found += [each for each in pids if Path(f"/proc/{each}/comm").read_text().strip() == KEPT_CHILD]
    return found


def is_stopped(pid: int) -> bool:
    """True while a process is stopped by a signal (proc(5): state T or t)."""
    found = process_stat(pid)
    return found is not None and found.is_stopped


def _gone(process: Running, end: float) -> bool:
    while is_it(process):
        if time.monotonic() > end:
            return False
        time.sleep(_STEP)
    return True


@contextmanager
def _turn(layout: Layout) -> Iterator[None]:
    """One start at a time; the kernel gives the lock back when its holder dies."""
    private_folder(layout.run)
    with held(layout.run / "start.lock"):
        yield


class _Begun(Protocol):
    """A start that was asked for."""

    taken: bool
    """True once it ended because another process owns the endpoint."""

    def ended(self) -> str | None:
        """How it ended before it served; None while it may still come."""

    def give_up(self) -> None:
        """End what does not come."""


class _Detached:
    """A process that was started here and belongs to no one."""

    def __init__(self, layout: Layout) -> None:
        import subprocess  # here, so that a client's pipe to a running endpoint does not load it

        self.taken = False
        with os.fdopen(_private(layout.server_log), "ab") as log:
            self._process = subprocess.Popen(
                [str(layout.endpoint / LAUNCHER)],
                cwd=layout.run,
                env={**{name: os.environ[name] for name in PASSED if name in os.environ}, MARK: processes.new(16)},
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                start_new_session=True,
            )

    def ended(self) -> str | None:
        status = self._process.poll()
        self.taken = status == TAKEN
        return None if status is None else f"its process ended with status {status}"

    def give_up(self) -> None:
        self._process.kill()
        self._process.wait()


def _start(layout: Layout, end: float) -> tuple[Running | None, Diagnostic | None]:
    private_folder(layout.logs)
    _rotate(layout.server_log)
    with os.fdopen(_private(layout.server_log), "ab") as log:
        mark = log.tell()
    begun: _Begun = systemd.started(layout) or _Detached(layout)
    socket, asked = os.fspath(layout.socket), time.monotonic()
    patience, pause = asked + STOP_SECONDS, _STEP
    while (now := time.monotonic()) < end:
        # In this order: the process that answers owns the endpoint, and then the record has no process before it.
        if _takes_clients(socket) and (found := running(layout)) is not None:
            return found, None
        why = begun.ended()
        if why is not None:
            if not begun.taken or now > patience:
                return None, _held(layout) if begun.taken else _failed(layout, mark, why)
            time.sleep(pause)  # the owner may be one that was killed and is not wholly gone
            pause *= 2
            begun = _Detached(layout)
        time.sleep(max(_STEP, (now - asked) * _SHARE))
    begun.give_up()
    return None, _failed(layout, mark, "it takes no clients")


def _rotate(log: Path) -> None:
    """A log that has grown large makes room for a new one."""
    try:
        if log.lstat().st_size <= LARGE_LOG:
            return
    except FileNotFoundError:
        return
    from octoform.endpoint.process.log_rotation import rotate  # here, so that a client's pipe does not load it

    rotate(log, held_open=False)


def _private(path: Path) -> int:
    """A file of ours to add to, made where there is none."""
    from octoform.base.files import make_way

    make_way(path)
    return os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)


def _held(layout: Layout) -> Diagnostic:
    """The kernel reports that a process owns the endpoint, and no record states which: none that was written here."""
    return error(
        "ENDPOINT-START-FAILED",
        "the endpoint did not start: a process that has no record of this machine serves this folder",
        path=str(layout.run),
        hint="it was started before this machine had its id, or in a container: stop it there, or end it (`fuser -v "
        f"{layout.run}/*` shows it), then octoform start",
    )


def _failed(layout: Layout, mark: int, why: str) -> Diagnostic:
    from octoform.base.files import stream

    with stream(layout.server_log) as log:
        log.seek(mark)
        text = log.read(1 << 20).decode("utf-8", "replace").strip()
    refusals = [line.partition("refused:")[2].strip() for line in text.splitlines() if "octoform: refused:" in line]
    detail = refusals[-1] if refusals else text[-1500:] or None
    hint = "octoform plan shows what differs from what was applied; octoform apply repairs it"
    return error("ENDPOINT-START-FAILED", f"the endpoint did not start: {why}", detail=detail, hint=hint)
