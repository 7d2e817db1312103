"""Run one foreign program within a time limit and leave nothing of it behind.

Generated code and package tools may hang, may print without end and may leave grandchildren in sessions of their
own, so a pipe and a `wait` are not enough: output goes to files (a survivor that holds a pipe cannot block the
reader), the program gets its own process group, and every process that bears this run's mark is killed at the end.
"""

import atexit
import errno
import json
import os
import select
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import IO, ClassVar, Literal

from octoform.base import processes, shortage
from octoform.records import dataclass

MARK = "OCTOFORM_RUN"
OUTPUT_LIMIT = 8_000_000
"""Bytes read of each stream; a report that is longer is not a report."""

SCRIPT = Path(__file__).parent / "scripts" / "fork_server.py"
FORK_SECONDS = 5.0
"""In which a fork server that has loaded forks, on a machine under load too."""
END_SECONDS = 1.0
"""In which a fork server ends once no client is left; it holds nothing that would be lost."""

PASSED = ("HOME", "PATH", "LANG", "LC_ALL", "TMPDIR", "TZ", "USER", "LOGNAME", "SHELL", "TERM")
"""Variables that every child gets: nearly what an MCP client hands to a stdio server, and no secrets."""


UNCHECKED = {"PY_KEY_VALUE_DISABLE_BEARTYPE": "true"}
"""Spares a library of FastMCP's, which no server uses, checks of each call: to make them is a tenth of a start."""


@dataclass(frozen=True, slots=True)
class Finished:
    """How a run ended. ``status`` is None after the time limit; ``survivors`` counts processes killed at the end."""

    status: int | None
    stdout: str
    stderr: str
    seconds: float
    survivors: int = 0

    @property
    def timed_out(self) -> bool:
        """True when the time limit ended the run."""
        return self.status is None


def base_environment() -> dict[str, str]:
    """The few variables of ours that a child may see."""
    return {name: os.environ[name] for name in PASSED if name in os.environ}


def serving_environment() -> dict[str, str]:
    """Those, and what keeps FastMCP from reading a .env of the working folder and from looking for a newer release."""
    return {
        **base_environment(),
        "FASTMCP_ENV_FILE": os.devnull,
        "FASTMCP_CHECK_FOR_UPDATES": "off",
        **UNCHECKED,
    }


def run(
    command: Sequence[str],
    *,
    cwd: Path,
    environment: Mapping[str, str],
    timeout: float,
    stdin: str = "",
    fork_server: "ForkServer | None" = None,
) -> Finished:
    """Run ``command`` for at most ``timeout`` seconds; as a fork of ``fork_server`` where one is given and works.

    Then ``command`` is its interpreter, ``-I``, a script and arguments. FileNotFoundError or PermissionError when it
    cannot start, BlockingIOError when it got no process or thread.
    """
    mark = processes.new()
    started = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as feed:
        feed.write(stdin.encode())
        feed.seek(0)
        marked_environment = {**environment, MARK: mark}
        streams = (feed.fileno(), out.fileno(), err.fileno())
        process: Forked | subprocess.Popen[bytes] | None = None
        if fork_server is not None and fork_server.loaded(timeout):
            process = fork_server.fork(command[2:], cwd, marked_environment, streams, mark)
        if process is None:
            process = subprocess.Popen(
                list(command),
                cwd=cwd,
                env=marked_environment,
                preexec_fn=_marked(mark),
                stdin=feed,
                stdout=out,
                stderr=err,
                start_new_session=True,
            )
        try:
            status: int | None = process.wait(max(0.0, timeout - (time.monotonic() - started)))
        except subprocess.TimeoutExpired:
            status = None
        finally:
            survivors = _clear(process, mark)
        return _served(Finished(status, _head(out), _head(err), time.monotonic() - started, survivors))


Purpose = Literal["servers", "pictures"]
"""What a fork server loads: what every server and every client needs, or what looks into a picture."""


class ForkServer:
    """An interpreter of a serving environment that has loaded what scripts of one purpose load.

    That takes a second or two of CPU time, once: scripts run as forks of it. It ends with this process, or after a
    minute without work; `at` gives the one of an interpreter. Where it does not load, `run` starts the script as a
    program of its own, which reports what is wrong.
    """

    _kept: ClassVar[dict[tuple[int | str, ...], "ForkServer"]] = {}
    _turn: ClassVar[threading.Lock] = threading.Lock()

    @classmethod
    def at(cls, python: Path, purpose: Purpose = "servers") -> "ForkServer":
        """The fork server of this interpreter, begun where none runs, or where its environment was built again.

        FileNotFoundError or PermissionError when there is no such interpreter.
        """
        with cls._turn:
            wanted = cls._key(python, purpose)
            for former in [key for key, server in cls._kept.items() if not server._lives()]:
                cls._kept.pop(former).end()
            if wanted not in cls._kept:
                cls._kept[wanted] = cls(python, purpose)
            return cls._kept[wanted]

    @staticmethod
    def _key(python: Path, purpose: Purpose = "servers") -> tuple[int | str, ...]:
        """The folder of the interpreter: the one above is changed by scripts, which leave their bytecode there."""
        status = python.parent.stat()
        return purpose, status.st_dev, status.st_ino, status.st_ctime_ns

    @classmethod
    def end_all(cls) -> None:
        """End those of this process."""
        with cls._turn:
            while cls._kept:
                cls._kept.popitem()[1].end()

    def __init__(self, python: Path, purpose: Purpose = "servers") -> None:
        """Begin to load; who needs it waits by `loaded`."""
        self._owner = os.getpid()
        self._loaded: bool | None = None
        self._waits = threading.Lock()
        self._orders, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with its:
            self._process = self._begun(python, purpose, its)

    @staticmethod
    def _begun(python: Path, purpose: Purpose, orders: socket.socket) -> "subprocess.Popen[bytes]":
        # Several projects may have the environment, each by a link of its own that goes with the project.
        folder = python.parents[1].resolve()
        return subprocess.Popen(
            [str(folder / "bin" / python.name), "-I", str(SCRIPT), str(orders.fileno()), purpose],
            cwd=folder,
            env=serving_environment(),
            pass_fds=[orders.fileno()],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def loaded(self, timeout: float) -> bool:
        """Wait until it has loaded; False when it ended before, or did not load within ``timeout`` seconds."""
        with self._waits:
            if self._loaded is None:
                self._orders.settimeout(timeout)
                try:
                    self._loaded = self._orders.recv(16) == b"ready"
                except OSError:
                    self._loaded = False
            return self._loaded

    def fork(
        self, argv: Sequence[str], cwd: Path, environ: Mapping[str, str], streams: tuple[int, int, int], mark: str
    ) -> "Forked | None":
        """A fork that runs the script ``argv[0]``; None when there can be none, BlockingIOError without a process."""
        order = json.dumps({"argv": list(argv), "cwd": str(cwd), "environ": dict(environ)}).encode()
        mine, its = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with ExitStack() as opened:
            opened.enter_context(mine)
            with its:
                try:
                    socket.send_fds(self._orders, [order], [its.fileno(), *streams])
                except OSError:  # it has ended
                    return None
            mine.settimeout(FORK_SECONDS)
            try:
                answer, descriptors, _, _ = socket.recv_fds(mine, 64, 1)
            except TimeoutError:  # a script has stopped it: it is replaced, and forks nothing that is not let begin
                self._loaded = False
                return None
            if not descriptors:
                if answer:
                    raise BlockingIOError(errno.EAGAIN, shortage.TEXT)
                return None
            forked = Forked(int(answer), descriptors[0], mine)
            # It begins after this: what the script starts in its first moments has to bear the mark too.
            if not processes.put_on(mark, forked.pid):
                os.close(descriptors[0])
                return None
            with suppress(BrokenPipeError):
                mine.send(b"g")
            opened.pop_all()
        return forked

    def end(self) -> None:
        """End it, and not what it has forked. One that a fork of this process inherited is left to this process."""
        self._loaded = False
        self._orders.close()
        if self._owner == os.getpid():
            try:
                self._process.wait(END_SECONDS)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()

    def _lives(self) -> bool:
        if self._loaded is False:
            return False
        # Once it has loaded it prints nothing more: what there is to read is its end.
        return not self._loaded or not _readable([self._orders.fileno()], 0)


atexit.register(ForkServer.end_all)


class Forked:
    """A script that runs as a fork of a fork server, in the form of `subprocess.Popen`."""

    LOST = 1
    """The status of one whose server ended before it, or was stopped."""

    def __init__(self, pid: int, pidfd: int, answers: socket.socket) -> None:
        self.pid = pid
        self._start = processes.start_of(pid)
        self._pidfd = pidfd
        self._answers = answers
        self._status: int | None = None

    def poll(self) -> int | None:
        """Its status, None while it runs."""
        try:
            return self.wait(0)
        except subprocess.TimeoutExpired:
            return None

    def wait(self, timeout: float | None = None) -> int:
        """Its status once it has ended; subprocess.TimeoutExpired when it has not in ``timeout`` seconds."""
        if self._status is None:
            started = time.monotonic()
            ready = self._await([self._answers.fileno(), self._pidfd], timeout)
            if self._answers.fileno() not in ready:  # it has ended: its server reports that at once, or is stopped
                ready = _readable([self._answers.fileno()], END_SECONDS)
            text = self._answers.recv(64) if ready else b""
            if not text:
                self._await([self._pidfd], timeout and max(0.0, timeout - (time.monotonic() - started)))
            self._status = int(text) if text else self.LOST
            self._answers.close()
            os.close(self._pidfd)
        return self._status

    def kill(self) -> None:
        """Kill it, if it has not ended."""
        if self._status is None:
            processes.signal_one(self.pid, self._start)

    def _await(self, descriptors: list[int], timeout: float | None) -> list[int]:
        ready = _readable(descriptors, timeout)
        if not ready:
            raise subprocess.TimeoutExpired([str(self.pid)], timeout or 0.0)
        return ready


def _readable(descriptors: Iterable[int], timeout: float | None) -> list[int]:
    """Those that can be read or have ended, within so many seconds; `select.select` takes none above 1023."""
    watched = select.poll()
    for each in descriptors:
        watched.register(each, select.POLLIN)
    return [descriptor for descriptor, _ in watched.poll(None if timeout is None else timeout * 1000)]


def _served(finished: Finished) -> Finished:
    """The run as it is; BlockingIOError where it failed because it got no process or thread: that is no fault of it."""
    if finished.status and shortage.printed(finished.stderr):
        raise BlockingIOError(errno.EAGAIN, shortage.TEXT)
    return finished


def _marked(mark: str) -> Callable[[], object]:
    """Puts the mark on between fork and exec: what a program starts in its first moments has to bear it too.

    Nothing is imported, opened or locked there, so that other threads of this process cannot hold it up.
    """
    return partial(processes.put_on, mark)


def _clear(process: "Forked | subprocess.Popen[bytes]", mark: str) -> int:
    """Kill what is left of the run; gives the number of processes besides ``process`` itself."""
    if process.poll() is None:
        if isinstance(process, Forked):
            process.kill()
        else:
            processes.signal_group(process)
        process.wait()
    return clear(mark)


def clear(mark: str, variable: str = MARK, *, spared: Collection[int] = ()) -> int:
    """Kill every process that bears the mark, ``spared`` omitted; how many there were."""
    killed: set[int] = set()
    while found := [pid for pid in marked(mark, variable) if pid not in killed and pid not in spared]:
        for pid in found:
            processes.signal_one(pid, processes.start_of(pid))
            killed.add(pid)
    return len(killed)


def marked(mark: str, variable: str = MARK) -> list[int]:
    """Live processes that bear the mark; empty where there is no /proc."""
    try:
        with os.scandir("/proc") as entries:
            names = [entry.name for entry in entries if entry.name.isdigit()]
    except OSError:
        return []
    return [int(name) for name in names if processes.bears(int(name), mark, variable)]


def _head(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read(OUTPUT_LIMIT).decode("utf-8", "replace")
