"""Run one program as a contained process tree: bounded in time, output and files, and with nothing left behind.

The program runs below the supervisor (`reaper`), which ends the whole tree even when this process is killed. This
side starts the supervisor, records it in the attempt's folder before anything of the agent runs, reads the output into
the bounded log, and ends whatever is left should the supervisor itself be killed. It uses one thread and no signal
handler, so it may be called from anywhere.
"""

import errno
import os
import selectors
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, Protocol

from octoform.base import processes, shortage
from octoform.base.files import parse
from octoform.harness.containment import orphans
from octoform.harness.containment.agent_environment import ATTEMPT
from octoform.harness.containment.reaper import PR_SET_CHILD_SUBREAPER, children, prctl
from octoform.harness.containment.task_log import DEFAULT_LIMIT, TaskLog
from octoform.records import dataclass, field, replace

REAPER = Path(__file__).with_name("reaper.py")
_LOAD = "import os, sys; sys.path.append(sys.argv.pop(1)); import reaper; os._exit(reaper.main(sys.argv[1:]))"
"""A script would be compiled at each start; a module has bytecode. Nothing is to be taken apart at its end."""
SUPERVISOR = ("-I", "-S", "-B", "-c", _LOAD, str(REAPER.parent))
"""What the interpreter is given to run the supervisor."""
CHUNK = 64 << 10
MARGIN_SECONDS = 15.0
FLOOD_PAUSE_SECONDS = 0.01
STREAMS = ("stdout", "stderr")
FILE_BYTES = 256 << 20
"""The most that any one file of an agent may have."""


@dataclass(slots=True)
class _Adopting:
    """How many runs of this process are going on."""

    runs: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock)


_ADOPTING = _Adopting()


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of a run: seconds in all, seconds between SIGTERM and SIGKILL, bytes of the log, bytes of any file."""

    wall_seconds: float
    grace_seconds: float = 2.0
    log_bytes: int = DEFAULT_LIMIT
    file_bytes: int = FILE_BYTES


@dataclass(frozen=True, slots=True)
class Program:
    """The program to run: ``stdin`` is a file, or None for no input; ``secrets`` are redacted from the log by name.

    ``piped`` is in place of a file for what may be in none: it can be read once, and by the first who does.
    """

    argv: tuple[str, ...]
    workdir: Path
    environment: Mapping[str, str]
    log: Path
    stdin: Path | None = None
    secrets: Mapping[str, str] = field(default_factory=dict)
    piped: bytes = field(default=b"", repr=False)


class Observer(Protocol):
    """Reads along while the program runs."""

    def feed(self, stream: str, data: bytes) -> None:
        """A piece of ``stdout`` or ``stderr``, redacted."""
        ...

    def tick(self) -> bool:
        """Called at least five times a second; True ends the tree."""
        ...

    def finish(self) -> None:
        """The output has ended; called once."""
        ...


@dataclass(frozen=True, slots=True)
class Ended:
    """How the tree ended.

    ``reason`` is ended, wall, ordered (by the observer), stopped, orphaned, not_started (``errno`` states why), lost
    (the supervisor was killed) or halted (it was stopped, and then killed from here).
    ``status`` is the program's exit status, negative for a signal, None when unknown. ``survivors`` counts processes
    besides the program itself that had to be ended, ``remaining`` those that could not be.
    """

    reason: str
    status: int | None = None
    errno: int = 0
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_rss: int = 0
    survivors: int = 0
    remaining: int = 0
    containment: str = "subreaper"
    log_bytes: int = 0
    log_dropped: int = 0


def run(program: Program, limits: Limits, observer: Observer) -> Ended:
    """Run it and wait for the end of its whole tree; OSError only for what octoform itself cannot write or start.

    An exception that comes meanwhile (an interrupt by the person, say) ends the tree and is passed on.
    """
    began = time.monotonic()
    mark = processes.new()
    with TaskLog(program.log, program.secrets, limits.log_bytes) as log:
        with _adopting() as adopted:
            session = _Session(program, limits, mark)
            try:
                record = session.record()
                orphans.write(program.workdir, record)
                found = session.follow(log, observer)
            finally:
                session.stop()
            seconds = time.monotonic() - began
            ended = _settle(found, record, seconds, "halted" if session.halted else "lost", adopted)
        if not ended.remaining:
            # The folder may be gone or full by what the agent did; the record only helps a later sweep.
            with suppress(OSError):
                orphans.write(program.workdir, orphans.Record(mark, record.pid, record.start, ended=True))
    if ended.reason == "not_started" and ended.errno == errno.EAGAIN:
        raise BlockingIOError(ended.errno, shortage.TEXT)
    return replace(ended, log_bytes=log.written, log_dropped=log.dropped)


def _stdin(program: Program) -> BinaryIO:
    if not program.piped:
        # A pipe in the place of the prompt is not waited for, and the program's own reads are none of ours.
        given = os.open(program.stdin or os.devnull, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        os.set_blocking(given, True)
        return os.fdopen(given, "rb")
    reader, writer = os.pipe()
    try:
        os.set_blocking(writer, False)
        if os.write(writer, program.piped) < len(program.piped):
            raise OSError(errno.E2BIG, os.strerror(errno.E2BIG))
    except OSError:
        os.close(reader)
        raise
    finally:
        os.close(writer)
    return os.fdopen(reader, "rb", buffering=0)


class _Session:
    """The running supervisor with its three streams."""

    def __init__(self, program: Program, limits: Limits, mark: str) -> None:
        self._limits = limits
        report, report_writer = os.pipe()
        control_reader, self._control = os.pipe()
        arguments = [str(report_writer), str(control_reader)]
        arguments += [f"{limits.wall_seconds:.3f}", f"{limits.grace_seconds:.3f}", str(limits.file_bytes)]
        try:
            with _stdin(program) as stdin:
                self._process = subprocess.Popen(
                    [sys.executable, *SUPERVISOR, *arguments, *program.argv],
                    cwd=program.workdir,
                    env={**program.environment, ATTEMPT: mark},
                    stdin=stdin,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    pass_fds=(report_writer, control_reader),
                    start_new_session=True,
                )
        except BaseException:
            os.close(report)
            os.close(self._control)
            raise
        finally:
            os.close(report_writer)
            os.close(control_reader)
        processes.put_on(mark, self._process.pid)  # before the agent starts, which waits for the byte of `follow`
        self._mark = mark
        self._report = report
        self._message = b""
        self._ordered = False
        self.halted = False

    def record(self) -> orphans.Record:
        """The supervisor's process, for the record in the attempt's folder."""
        found = orphans.look(self._process.pid)
        return orphans.Record(self._mark, self._process.pid, found.start if found else 0)

    def follow(self, log: TaskLog, observer: Observer) -> bytes:
        """Let the agent start, and read until the supervisor has ended; its report line (empty when it was killed)."""
        with suppress(BrokenPipeError):
            os.write(self._control, b"g")
        give_up = time.monotonic() + self._limits.wall_seconds + self._limits.grace_seconds + MARGIN_SECONDS
        with selectors.DefaultSelector() as selector:
            for name, stream in zip(STREAMS, (self._process.stdout, self._process.stderr), strict=True):
                if stream is not None:
                    os.set_blocking(stream.fileno(), False)
                    selector.register(stream.fileno(), selectors.EVENT_READ, name)
            selector.register(self._report, selectors.EVENT_READ, "report")
            while self._report in selector.get_map() and time.monotonic() < give_up:
                for key, _ in selector.select(0.2):
                    self._take(selector, key, log, observer)
                if self._is_halted():
                    break
                if observer.tick():
                    self._order_end()
                if log.full:
                    time.sleep(FLOOD_PAUSE_SECONDS)
            self._drain(selector, log, observer)
        for name in STREAMS:
            observer.feed(name, log.rest(name))
        observer.finish()
        return self._message

    def _take(
        self, selector: selectors.BaseSelector, key: selectors.SelectorKey, log: TaskLog, observer: Observer
    ) -> bool:
        """Read one piece of one stream; False when it has nothing now or has ended."""
        try:
            data = os.read(key.fd, CHUNK)
        except BlockingIOError:
            return False
        if not data:
            selector.unregister(key.fd)
            return False
        if key.data == "report":
            self._message += data
            return True
        observer.feed(key.data, log.feed(key.data, data))
        return True

    def _is_halted(self) -> bool:
        """Whether somebody has stopped the supervisor, and with it the limits; it is ended, and so is all below it.

        A supervisor that let it go on could be stopped by the same agent again and again.
        """
        found = orphans.look(self._process.pid)
        if found is None or found.state not in "Tt":
            return False
        self.halted = True
        self._process.kill()
        return True

    def _order_end(self) -> None:
        """Report to the supervisor, once, that the tree has to go."""
        if not self._ordered:
            self._ordered = True
            with suppress(BrokenPipeError):
                os.write(self._control, b"e")

    def _drain(self, selector: selectors.BaseSelector, log: TaskLog, observer: Observer) -> None:
        """Read the rest of the pipes after the end: at most their capacity, and a bound against a live writer."""
        for key in list(selector.get_map().values()):
            rounds = 64
            while key.data != "report" and rounds and self._take(selector, key, log, observer):
                rounds -= 1

    def stop(self) -> None:
        """End the tree if it still runs (closing the control pipe states that), and release everything."""
        os.close(self._control)
        os.close(self._report)
        try:
            self._process.wait(self._limits.grace_seconds + MARGIN_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()


@contextmanager
def _adopting() -> Iterator[orphans.Adopted | None]:
    """While it lasts, a descendant that loses its parent becomes a child of this process; None where the system cannot.

    So what an agent has hidden cannot get away from here by killing its supervisor.
    """
    before = frozenset(filter(None, map(orphans.look, children())))
    with _ADOPTING.lock:
        _ADOPTING.runs += 1
        possible = prctl(PR_SET_CHILD_SUBREAPER, 1)
    try:
        yield orphans.Adopted(os.getpid(), before) if possible else None
    finally:
        with _ADOPTING.lock:
            _ADOPTING.runs -= 1
            if not _ADOPTING.runs:
                prctl(PR_SET_CHILD_SUBREAPER, 0)


def _settle(
    data: bytes, record: orphans.Record, seconds: float, without: str, adopted: orphans.Adopted | None
) -> Ended:
    """The supervisor's report as a value; ``without`` one it was killed, and its orphans are ended from here."""
    try:
        return Ended(**parse(data))
    except (ValueError, TypeError):
        swept = orphans.end_marked((record,), adopted)
        return Ended(without, seconds=seconds, survivors=len(swept.ended), remaining=len(swept.left))
