"""Calls a function in a process of its own, so that what its libraries keep in memory goes when it is idle.

A library such as OpenCV stays in a process for good once it was imported, with some fifty megabytes. So the function
that imports it is called in a copy of this process, which is kept while calls come and ends by itself soon after the
last one. Arguments and results are plain values: numbers, texts, bytes, None, and lists, tuples and tables of them.

The copy has none of the other files that this process has open: a lock that it kept would outlive its release.
It ends with the call that takes too long, with the process that started it, and when no call has come for a while.
Where a system's own libraries do not bear being copied (macOS), the function is called here.
"""

import gc
import marshal
import numbers
import os
import select
import signal
import struct
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from .base.processes import signal_one, start_of
from .faults import DeviceFault

IDLE = 20.0
"""Seconds after the last call at which the process ends."""
TIMEOUT = 90.0
"""Seconds that one call may take: a tool may record for a minute."""
NAME = "runtime-child"
"""The process name of such a child, so that it is not mistaken for one that a tool has left running."""
_PAUSE = 50
"""Milliseconds between two looks whether the caller was interrupted."""
_HEAD = struct.Struct("=I")
_PIECE = 1 << 16
_MAX_FILES = 1 << 20
_lock = threading.Lock()
_idle: dict[Callable[..., Any], list["_Child"]] = {}


def call(function: Callable[..., Any], *plain: Any) -> Any:
    """The result of the function for these plain values, from a process of its own.

    Its errors are raised here: OSError, ImportError, DeviceFault and FastMCP's ToolError as they are, others as
    RuntimeError. TimeoutError after `TIMEOUT` seconds, ConnectionError when the process dies.
    """
    if not hasattr(os, "pidfd_open"):  # a system whose libraries do not bear being copied
        return function(*plain)
    request = marshal.dumps((TIMEOUT, _plain(plain)))
    while True:
        child, is_new = _taken(function)
        try:
            kind, *answer = marshal.loads(child.ask(request, TIMEOUT))
        except BaseException as problem:
            child.end()
            if isinstance(problem, ConnectionError) and child.status == 0 and not is_new:
                continue  # it had been idle for so long that it was about to end
            raise
        _give_back(function, child)
        return answer[0] if kind == "value" else _raise(kind, answer)


class _Child:
    """One copy of this process: the pipes to it, and how it ended."""

    def __init__(self, function: Callable[..., Any]) -> None:
        asked, self._asks = os.pipe()
        self._answers, found = os.pipe()
        self.ended = threading.Event()
        self._reaped = threading.Lock()
        self.status: int | None = None
        self.pid = os.fork()
        if self.pid == 0:
            _serve(function, asked, found)
        self._start = start_of(self.pid)
        os.close(asked)
        os.close(found)
        threading.Thread(target=self._await_end, daemon=True, name="child").start()

    def ask(self, request: bytes, timeout: float) -> bytes:
        """The answer to a request; ConnectionError when the process ends before."""
        end = time.monotonic() + timeout
        try:
            _write(self._asks, request)
        except BrokenPipeError:
            raise self._lost() from None
        found, size = bytearray(), 0
        looks = select.poll()
        looks.register(self._answers, select.POLLIN)
        while len(found) < _HEAD.size or len(found) < size:
            if time.monotonic() >= end:
                raise TimeoutError(f"it took longer than {timeout:g} s")
            if not looks.poll(_PAUSE):
                continue
            piece = os.read(self._answers, _PIECE)
            if not piece:
                raise self._lost()
            found += piece
            size = _HEAD.size + _HEAD.unpack_from(found)[0] if len(found) >= _HEAD.size else 0
        return bytes(found[_HEAD.size :])

    def end(self) -> None:
        """End the process now, and wait until it is gone."""
        with self._reaped:
            if self.status is None:
                signal_one(self.pid, self._start)
        self.ended.wait()
        self.close()

    def close(self) -> None:
        """Close the pipes of a process that has ended."""
        os.close(self._asks)
        os.close(self._answers)

    def _lost(self) -> ConnectionError:
        self.ended.wait(1.0)
        status = self.status or 0
        how = f"signal {os.WTERMSIG(status)}" if os.WIFSIGNALED(status) else f"status {status >> 8}"
        return ConnectionError(f"the process in which the library runs ended with {how}")

    def _await_end(self) -> None:
        """Learn that the process has ended, at whatever time that is, so that nothing of it is left."""
        looks = select.poll()
        looks.register(self._answers, 0)  # reports when the other end is closed, and nothing else
        looks.poll()
        with self._reaped:
            self.status = os.waitpid(self.pid, 0)[1]
        with _lock:
            kept = [childs for childs in _idle.values() if self in childs]
            for childs in kept:
                childs.remove(self)
        self.ended.set()
        if kept:
            self.close()


def _taken(function: Callable[..., Any]) -> tuple["_Child", bool]:
    """A process of the function that waits for a call, or a new one, and whether it is new."""
    with _lock:
        waiting = _idle.setdefault(function, [])
        if waiting:
            return waiting.pop(), False
    return _Child(function), True


def _give_back(function: Callable[..., Any], child: _Child) -> None:
    with _lock:
        if child.status is None:
            _idle[function].append(child)
            return
    child.ended.wait()
    child.close()


def _serve(function: Callable[..., Any], asked: int, writer: int) -> NoReturn:
    """Answer requests until none comes for a while, or its client is gone."""
    try:
        gc.disable()  # what was copied is not this process's to clean up
        signal.set_wakeup_fd(-1)
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGCHLD, signal.SIGALRM):
            signal.signal(number, signal.SIG_DFL)
        _close_others(asked, writer)
        Path("/proc/self/comm").write_text(NAME)
        os.dup2(2, 1)  # what a library prints is no answer
        looks = select.poll()
        looks.register(asked, select.POLLIN)
        while looks.poll(IDLE * 1000):
            request = _read(asked)
            if request is None:
                break
            timeout, arguments = marshal.loads(request)
            signal.setitimer(signal.ITIMER_REAL, timeout + 1)  # for when no process is there to end it
            answer = _outcome(function, arguments)
            signal.setitimer(signal.ITIMER_REAL, 0)
            _write(writer, answer)
    finally:
        os._exit(0)


def _close_others(*kept: int) -> None:
    """Close what the process has open besides its standard streams and these."""
    first = 3
    for number in sorted(kept):
        os.closerange(first, number)
        first = number + 1
    os.closerange(first, _MAX_FILES)


def _outcome(function: Callable[..., Any], arguments: tuple[Any, ...]) -> bytes:
    try:
        return marshal.dumps(("value", _plain(function(*arguments))))
    except OSError as problem:
        name = problem.filename if isinstance(problem.filename, str) else None
        return marshal.dumps(("OSError", problem.errno, problem.strerror or str(problem), name))
    except ImportError as problem:
        return marshal.dumps((type(problem).__name__, str(problem), problem.name))
    except DeviceFault as problem:
        return marshal.dumps(("DeviceFault", problem.device, str(problem)))
    except Exception as problem:  # noqa: BLE001 - whatever it is, the caller gets it
        return marshal.dumps((type(problem).__name__, str(problem)))


def _raise(kind: str, fields: list[Any]) -> NoReturn:
    if kind == "OSError":
        number, text, name = fields
        raise OSError(number, text, name) if number else OSError(text)
    if kind in ("ImportError", "ModuleNotFoundError"):
        raise (ModuleNotFoundError if kind.startswith("M") else ImportError)(fields[0], name=fields[1])
    if kind == "DeviceFault":
        raise DeviceFault(*fields)
    known = getattr(sys.modules.get("fastmcp.exceptions"), "ToolError", None)
    if kind == "ToolError" and isinstance(known, type) and issubclass(known, Exception):
        raise known(fields[0])
    raise RuntimeError(f"{kind}: {fields[0]}")


def _plain(value: Any) -> Any:
    """The value of plain types alone; TypeError names what cannot be handed from one process to another."""
    if value is None or isinstance(value, bool):
        return value
    for kind, plain in ((numbers.Integral, int), (numbers.Real, float), (str, str)):
        if isinstance(value, kind):
            made: Any = plain
            return made(value)
    if isinstance(value, bytes | bytearray):
        return bytes(value)
    if isinstance(value, list | tuple):
        return type(value)(map(_plain, value)) if type(value) in (list, tuple) else [*map(_plain, value)]
    if isinstance(value, dict):
        return {_plain(key): _plain(item) for key, item in value.items()}
    raise TypeError(f"{type(value).__name__} is no plain value; return numbers, texts, bytes, lists and tables")


def _write(pipe: int, data: bytes) -> None:
    left = memoryview(_HEAD.pack(len(data)) + data)
    while left:
        left = left[os.write(pipe, left) :]


def _read(pipe: int) -> bytes | None:
    """A whole message; None when the other end is gone."""
    found = bytearray()
    while len(found) < _HEAD.size or len(found) < _HEAD.size + _HEAD.unpack_from(found)[0]:
        piece = os.read(pipe, _PIECE)
        if not piece:
            return None
        found += piece
    return bytes(found[_HEAD.size :])
