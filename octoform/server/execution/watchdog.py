"""Generated code that blocks the event loop stops everybody: no deadline comes, no other client is answered.

A thread asks the loop for a turn again and again. When none comes, the main thread's stack shows whose fault it is, and
a signal is sent whose handler raises there; a signal also ends a system call that waits, which an exception alone
cannot. It raises only where generated code runs, or what that called: never while this package's own code does, which
then ends what it began, and never in another call than the one that was found.
"""

import asyncio
import contextvars
import ctypes
import logging
import os
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from types import CodeType, FrameType
from typing import Any, Protocol

from octoform.server.internals import tool_thread

try:  # where a server has it, anyio asks it which event loop this is
    from sniffio import current_async_library_cvar as _LIBRARY
except ImportError:
    _LIBRARY = None  # type: ignore[assignment]

# Threads for the tools that block, which can be stopped.
#
# The threads of a common pool belong to all its users, so no one may raise an exception in one. These run one call at
# a time and know which, and only while the tool's own code runs is anything raised in it. A thread that was interrupted
# ends with its call: an exception that comes late can never hit the next one.

IDLE = 8
"""Threads that wait for the next call; more than that end."""


class Interrupted(BaseException):
    """Raised inside a tool that has to stop; no tool's `except Exception` takes it for a fault of its device."""


Report = Callable[[Any, BaseException | None], None]


class Job:
    """A function, the context it runs in, and who hears what became of it (on the event loop).

    ``stopped`` once it was interrupted: it does not begin any more; ``over`` once its thread has left the function.
    """

    __slots__ = ("context", "function", "over", "report", "stopped", "worker")

    def __init__(self, function: Callable[[], Any], report: Report) -> None:
        self.function = function
        self.report = report
        self.context = contextvars.copy_context()
        self.worker: Worker | None = None
        self.stopped = self.over = False

    def interrupt(self) -> None:
        """Raise Interrupted in the function if it runs, and keep it from beginning if it does not; from any thread."""
        self.stopped = True
        if self.worker is not None:
            self.worker.interrupt(self)


class Workers:
    """The threads of one event loop."""

    def __init__(self) -> None:
        self._idle: list[Worker] = []

    def start(self, job: Job) -> None:
        """Run a job in a thread; its report is called on this event loop."""
        if self._idle:
            worker = self._idle.pop()
        else:
            worker = Worker(asyncio.get_running_loop(), self._back)
            worker.start()
        job.worker = worker
        worker.inbox.put(job)

    def close(self) -> None:
        """End the threads that wait."""
        while self._idle:
            self._idle.pop().inbox.put(None)

    def _back(self, worker: "Worker", job: Job, value: Any, problem: BaseException | None) -> None:
        """On the event loop: the job is over."""
        if worker.soiled or len(self._idle) >= IDLE:
            worker.inbox.put(None)
        else:
            self._idle.append(worker)
        job.report(value, problem)


class Worker(threading.Thread):
    """One thread; ``soiled`` once it was interrupted."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        back: Callable[["Worker", Job, Any, BaseException | None], None],
    ) -> None:
        super().__init__(name="tool", daemon=True)
        self.inbox: SimpleQueue[Job | None] = SimpleQueue()
        self.soiled = False
        self._loop = loop
        self._back = back
        self._lock = threading.Lock()
        self._current: Job | None = None

    def interrupt(self, job: Job) -> None:
        """Raise Interrupted in the thread if it still works on ``job``."""
        with self._lock:
            if self._current is job and self.ident is not None:
                self.soiled = True
                ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self.ident), ctypes.py_object(Interrupted))

    def run(self) -> None:
        with tool_thread(self._loop):
            while (job := self.inbox.get()) is not None:
                value, problem = self._perform(job)
                try:
                    self._loop.call_soon_threadsafe(self._back, self, job, value, problem)
                except RuntimeError:  # the loop is closed, and with it everybody who waited
                    return
                del job, value, problem

    def _perform(self, job: Job) -> tuple[Any, BaseException | None]:
        value, problem = None, None
        try:
            self._enter(job)
            value = job.context.run(_call, job.function)
        except BaseException as raised:  # noqa: BLE001 - whatever a tool raises, this thread lives on
            problem = raised
        while True:
            try:
                self._leave()
                job.over = True
                return value, problem
            except Interrupted:  # came in the moment in which the function returned
                continue

    def _enter(self, job: Job) -> None:
        with self._lock:
            if job.stopped:
                raise Interrupted
            self._current = job

    def _leave(self) -> None:
        """From here on nothing is raised in this thread, and what was on its way is taken back."""
        with self._lock:
            self._current = None
        if self.soiled:
            ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self.ident or 0), None)


def _call(function: Callable[[], Any]) -> Any:
    # What runs here is no part of the event loop, although its context was copied from there.
    if _LIBRARY is not None:
        _LIBRARY.set(None)
    return function()


LOG = logging.getLogger("octoform.server")
EVERY = 0.5
"""Seconds between two looks, and what a loop has for one turn when a call on it is over its time."""
BLOCKED_SECONDS = 2.0
"""What a loop has for one turn else. Counted in looks, so that a machine that slept or had no time blames no one."""
_LOOP = asyncio.Handle._run.__code__
"""Where the event loop calls what is ready."""
_PACKAGES = tuple(f"{Path(__file__).parents[2] / name}{os.sep}" for name in ("server", "policy", "base"))


class Blocked(Exception):
    """Raised in generated code that our own code had called, as any exception of that code might have been."""


class Overdue(Protocol):
    """A call on the event loop with its deadline (monotonic seconds); ``blocked`` once it was interrupted before."""

    deadline: float
    tool: str
    blocked: bool


@dataclass(frozen=True, slots=True)
class Fault:
    """Generated code on the main thread: the call that it runs for, else its outermost frame, and what ends it."""

    owner: object
    call: Any
    raised: type[BaseException]
    where: str

    @property
    def overdue(self) -> bool:
        """True when it is a call whose time is over."""
        return self.call is not None and time.monotonic() > self.call.deadline


class Watchdog:
    """Knows the calls that run on the event loop. One for the process; ``arm`` in the main thread."""

    def __init__(self) -> None:
        self._calls: set[Any] = set()
        self._frames: frozenset[CodeType] = frozenset()
        self._generated: str | None = None
        self._ended = threading.Event()
        self._suspect: object = None
        self._blocked = False
        self._done: deque[Fault] = deque()

    def watch(self, call: Overdue) -> None:
        self._calls.add(call)

    def forget(self, call: Overdue) -> None:
        self._calls.discard(call)

    def cover(self, folder: Path) -> None:
        """Files below ``folder`` are generated code, no matter who runs it: also a task that a tool left behind."""
        self._generated = str(folder) + os.sep

    def arm(self, frames: frozenset[CodeType]) -> bool:
        """Watch the running loop; ``frames`` are the functions that a tool runs in, with its call as ``work``.

        False where that cannot be: the loop does not run in the main thread, whose signals these are.
        """
        if threading.current_thread() is not threading.main_thread():
            return False
        self.disarm()
        self._frames = frames
        self._ended = threading.Event()
        signal.signal(signal.SIGUSR2, self._handle)
        looks = (asyncio.get_running_loop(), self._ended)
        threading.Thread(target=self._look, args=looks, name="watchdog", daemon=True).start()
        return True

    def disarm(self) -> None:
        """Watch no more."""
        self._ended.set()

    def _look(self, loop: asyncio.AbstractEventLoop, ended: threading.Event) -> None:
        turned, silent = _asked(loop), 0
        while not ended.wait(EVERY):
            self._report_interrupts()
            if turned.is_set():
                turned, silent = _asked(loop), 0
                continue
            silent += 1
            blocked = silent * EVERY >= BLOCKED_SECONDS
            if blocked or self._overdue():
                self._accuse(blocked)

    def _accuse(self, blocked: bool) -> None:
        """Interrupt whose code stands on the main thread: any when it is ``blocked``, else a call over its time."""
        main = threading.main_thread().ident or 0
        fault = self._fault(sys._current_frames().get(main))
        if fault is not None and (blocked or fault.overdue):
            self._blocked, self._suspect = blocked, fault.owner
            signal.pthread_kill(main, signal.SIGUSR2)

    def _overdue(self) -> bool:
        now = time.monotonic()
        return any(now > call.deadline for call in tuple(self._calls))

    def _fault(self, frame: FrameType | None) -> Fault | None:
        """The tool whose code the main thread runs; None while it is our own, the loop's or a library's."""
        outermost, where, generated = None, "", False
        while frame is not None and not _is_ours(frame) and frame.f_code is not _LOOP:
            if self._generated is not None and frame.f_code.co_filename.startswith(self._generated):
                generated = True
                where = where or f"{frame.f_code.co_filename}:{frame.f_lineno}"
            outermost, frame = frame, frame.f_back
        if outermost is None:
            return None
        caller = frame
        while caller is not None and _is_ours(caller):
            if caller.f_code in self._frames:
                work: Any = caller.f_locals.get("work")
                return Fault(work, work, Interrupted, where) if work in self._calls else None
            caller = caller.f_back
        if not generated:
            return None
        called = frame is not None and frame.f_code is not _LOOP
        return Fault(outermost, None, Blocked if called else Interrupted, where)

    def _handle(self, _: int, frame: FrameType | None) -> None:
        """In the main thread, between two of its instructions. Nothing is written here: it may be in a write."""
        suspect, self._suspect = self._suspect, None
        fault = self._fault(frame)
        if fault is None or fault.owner is not suspect or not (self._blocked or fault.overdue):
            return  # it went on in the meantime
        if fault.call is not None and not fault.overdue:
            fault.call.blocked = True
        self._done.append(fault)
        raise fault.raised

    def _report_interrupts(self) -> None:
        """In the watching thread: what was interrupted since the last look."""
        while self._done:
            fault = self._done.popleft()
            who = f"the tool {fault.call.tool}" if fault.call is not None else "code that a tool left behind"
            LOG.error("%s blocked every other call and was interrupted %s", who, fault.where and f"at {fault.where}")


def _is_ours(frame: FrameType) -> bool:
    return frame.f_code.co_filename.startswith(_PACKAGES)


def _asked(loop: asyncio.AbstractEventLoop) -> threading.Event:
    """An event that is set once the loop turns; at once when the loop is closed."""
    turned = threading.Event()
    try:
        loop.call_soon_threadsafe(turned.set)
    except RuntimeError:
        turned.set()
    return turned


WATCHDOG = Watchdog()
