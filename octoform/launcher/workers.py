"""Threads for the tools that block, which can be told to stop.

The threads of a common pool belong to whoever uses it, so nobody may raise an exception in one. These run one call at
a time and know which, and only while the tool's own code runs is anything raised in it. A thread that was interrupted
ends with its call: an exception that comes late can never hit the next one.
"""

import asyncio
import contextvars
import ctypes
import threading
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any

from anyio._backends._asyncio import AsyncIOBackend
from anyio._core._eventloop import claim_worker_thread, set_current_async_library

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
        with claim_worker_thread(AsyncIOBackend, self._loop):
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
    set_current_async_library(None)
    return function()
