"""Run one foreign program within a time limit and leave nothing of it behind.

Generated code and package tools may hang, may print without end and may leave grandchildren in sessions of their
own, so a pipe and a `wait` are not enough: output goes to files (a survivor that holds a pipe cannot block the
reader), the program gets its own process group, and every process that bears this run's mark is killed at the end.
"""

import errno
import os
import subprocess
import tempfile
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO

from octoform.base import processes, shortage

MARK = "OCTOFORM_RUN"
OUTPUT_LIMIT = 8_000_000
"""Bytes read of each stream; a report that is longer is not a report."""

PASSED = ("HOME", "PATH", "LANG", "LC_ALL", "TMPDIR", "TZ", "USER", "LOGNAME", "SHELL", "TERM")
"""Variables that every child gets: nearly what an MCP client hands to a stdio server, and no secrets."""


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


def run(
    command: Sequence[str],
    *,
    cwd: Path,
    environment: Mapping[str, str],
    timeout: float,
    stdin: str = "",
) -> Finished:
    """Run ``command`` for at most ``timeout`` seconds.

    FileNotFoundError or PermissionError when it cannot start, BlockingIOError when it got no process or thread.
    """
    mark = processes.new()
    started = time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as feed:
        feed.write(stdin.encode())
        feed.seek(0)
        process = subprocess.Popen(
            list(command),
            cwd=cwd,
            env={**environment, MARK: mark},
            preexec_fn=_marked(mark),
            stdin=feed,
            stdout=out,
            stderr=err,
            start_new_session=True,
        )
        try:
            status: int | None = process.wait(timeout)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            survivors = _clear(process, mark)
        return _served(Finished(status, _head(out), _head(err), time.monotonic() - started, survivors))


class Begun:
    """A program that was started before its task is known, so that it can load meanwhile.

    It is given its task on standard input by `finish`; `drop` ends it without one. One of both has to be called.
    """

    def __init__(self, command: Sequence[str], *, cwd: Path, environment: Mapping[str, str]) -> None:
        """Start it; FileNotFoundError or PermissionError when that does not work."""
        self._mark = processes.new()
        with ExitStack() as opened:
            self._out = opened.enter_context(tempfile.TemporaryFile())
            self._err = opened.enter_context(tempfile.TemporaryFile())
            self._process = subprocess.Popen(
                list(command),
                cwd=cwd,
                env={**environment, MARK: self._mark},
                preexec_fn=_marked(self._mark),
                stdin=subprocess.PIPE,
                stdout=self._out,
                stderr=self._err,
                start_new_session=True,
            )
            self._files = opened.pop_all()

    def finish(self, stdin: str, timeout: float) -> Finished:
        """Hand it its task and wait for its end, for at most ``timeout`` seconds, which are counted from now."""
        started = time.monotonic()
        try:
            self._process.communicate(stdin.encode(), timeout)
            status: int | None = self._process.returncode
        except subprocess.TimeoutExpired:
            status = None
        except BaseException:
            self.drop()
            raise
        survivors = _clear(self._process, self._mark)
        finished = Finished(status, _head(self._out), _head(self._err), time.monotonic() - started, survivors)
        self._close()
        return _served(finished)

    def drop(self) -> None:
        """End it, with all that it has started; nothing when it has ended by `finish`."""
        if not self._out.closed:
            _clear(self._process, self._mark)
            self._close()

    def _close(self) -> None:
        if self._process.stdin is not None:
            with suppress(BrokenPipeError):
                self._process.stdin.close()
        self._files.close()


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


def _clear(process: "subprocess.Popen[bytes]", mark: str) -> int:
    """Kill what is left of the run; gives the number of processes besides ``process`` itself."""
    if process.poll() is None:
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
        entries = list(Path("/proc").iterdir())
    except OSError:
        return []
    pids = (int(entry.name) for entry in entries if entry.name.isdigit())
    return [pid for pid in pids if processes.bears(pid, mark, variable)]


def _head(file: IO[bytes]) -> str:
    file.seek(0)
    return file.read(OUTPUT_LIMIT).decode("utf-8", "replace")
