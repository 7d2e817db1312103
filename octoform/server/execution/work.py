"""The device work of a call: where it runs, how long it may, and what stops it.

FastMCP gives a blocking tool to a thread that nothing can cancel, so its time limit only holds once the tool returns by
itself. Here each tool's function is replaced, as the server is loaded and with its code unchanged, by one that runs it
where it can be reached: a blocking one in a thread that an exception can be raised in, an async one in a task of its
own. The client is answered at the deadline, whatever the tool does then; the buses stay taken until it really ended.
"""

import asyncio
import functools
import inspect
import logging
import math
import os
import time
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import aclosing, suppress
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

from fastmcp.exceptions import FastMCPError, ToolError
from fastmcp.tools.base import Tool
from fastmcp.tools.function_tool import FunctionTool
from mcp.shared.exceptions import MCPError
from mcp_types import MISSING_REQUIRED_CLIENT_CAPABILITY

from octoform.base.shortage import TEXT

from .result_size import at_least
from .watchdog import WATCHDOG, Interrupted, Job, Workers

LOG = logging.getLogger("octoform.server")
GUARDED = "__octoform_guarded__"
current: ContextVar["Work | None"] = ContextVar("octoform_work", default=None)
"""The work of the call that is being answered."""


@dataclass(frozen=True, slots=True)
class Patience:
    """Seconds: for a stopped tool to end before its client is answered, before its buses count as stuck, and between
    two attempts to stop it."""

    answer: float = 0.2
    stuck: float = 2.0
    again: float = 1.0


class Stopped(FastMCPError):
    """The device work was stopped; ``ended`` states whether it is over.

    ``cause`` is timeout, blocked (it held up every other call), cancelled, estop or shutdown.
    """

    def __init__(self, cause: str, ended: bool) -> None:
        super().__init__(cause, log_level=logging.DEBUG)
        self.cause = cause
        self.ended = ended


class TooLarge(FastMCPError):
    """The result is over its bound; ``size`` in bytes is at least this."""

    def __init__(self, size: int) -> None:
        super().__init__(f"{size} bytes", log_level=logging.DEBUG)
        self.size = size


class Work:
    """The device work of one call, from before it begins until its code has really ended.

    ``on_end`` is called once, on the event loop, when the code ended or it is certain that it will not begin;
    ``on_stuck`` when it goes on although it was instructed to stop.
    """

    __slots__ = (
        "_again",
        "_future",
        "_job",
        "_loop",
        "_task",
        "_timer",
        "_workers",
        "begun",
        "blocked",
        "bound",
        "cause",
        "deadline",
        "ended",
        "halted",
        "inline",
        "on_end",
        "on_stuck",
        "patience",
        "pinned",
        "reference",
        "reported",
        "stuck",
        "tool",
    )  # fmt: skip

    def __init__(self, tool: str, workers: Workers, patience: Patience, bound: int) -> None:
        self.tool = tool
        self.bound = bound
        self.patience = patience
        self.on_end: Callable[[], None] | None = None
        self.on_stuck: Callable[[], None] | None = None
        self.begun = self.ended = self.stuck = self.inline = self.blocked = False
        self.cause = self.halted = ""
        self.deadline = math.inf
        self.reported: BaseException | None = None
        self.pinned: Tool | None = None
        self.reference = ""
        self._workers = workers
        self._loop = asyncio.get_running_loop()
        self._future: asyncio.Future[Any] | None = None
        self._job: Job | None = None
        self._task: asyncio.Task[Any] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._again: asyncio.TimerHandle | None = None

    def limit(self, seconds: float) -> None:
        """Stop the work in ``seconds``."""
        self.deadline = time.monotonic() + seconds
        self._timer = self._loop.call_later(seconds, self.stop, "timeout")

    async def run(self, function: Callable[[], Any]) -> Any:
        """The value of a blocking function, run in a thread."""
        self._job = job = Job(function, self._report)  # before the look: a halt that comes after it finds the job
        self._begin()
        try:
            self._workers.start(job)
        except RuntimeError:  # no more threads on this machine: the tool has not begun, and the next call may do
            self.begun = False
            self._end()
            self.reported = ToolError(f"{TEXT} on the host of the endpoint; the tool was not called")
            raise self.reported from None
        return await self._outcome()

    async def run_async(self, function: Callable[[], Coroutine[Any, Any, Any]]) -> Any:
        """The value of an async function, run in a task of its own."""
        self._begin()
        self._task = self._loop.create_task(_in_task(self, function))
        WATCHDOG.watch(self)
        return await self._outcome()

    def run_inline(self, function: Callable[[], Any]) -> Any:
        """The value of a blocking function that may only run on the event loop's own thread."""
        self._begin()
        self.inline = True
        WATCHDOG.watch(self)
        try:
            return _on_loop(self, function)
        except Interrupted as problem:
            raise self._stopped(ended=True) from problem
        finally:
            self._end()

    def awaited(self, value: Awaitable[Any]) -> Any:
        """In the tool's thread: what a blocking function gave back to be awaited on the event loop."""

        async def wait() -> Any:
            return await value

        return asyncio.run_coroutine_threadsafe(wait(), self._loop).result()

    def stop(self, cause: str) -> None:
        """On the event loop: stop the work, answer the client soon, and go on until the work has ended."""
        if self.cause or self.ended:
            return
        self.cause = cause
        self.deadline = min(self.deadline, time.monotonic())
        if not self.begun:
            return
        self._interrupt()
        self._again = self._loop.call_later(self.patience.answer, self._give_up)

    @property
    def over(self) -> bool:
        """Whether none of its code runs, nor ever will; from any thread, also while the event loop is blocked."""
        unbegun = bool(self.halted) and not self.begun
        return self.ended or unbegun or (self._job is not None and self._job.over)

    def halt(self, cause: str) -> None:
        """`stop`, from any thread, also while the event loop is blocked by this very work. What has not begun when
        this returns does not begin any more."""
        if self.halted:
            return
        self.deadline = min(self.deadline, time.monotonic())
        self.halted = cause
        if self._job is not None:
            self._job.interrupt()
        with suppress(RuntimeError):  # the loop is closed, and with it everybody who waited
            self._loop.call_soon_threadsafe(self.stop, cause)

    def close(self) -> None:
        """The call is over: no deadline any more. Work that never began is over with it."""
        if self._timer is not None:
            self._timer.cancel()
        if not self.begun:
            self._end()

    def _begin(self) -> None:
        self.begun = True
        if self.cause or self.halted:  # looked at last, so that a halt either is seen here or sees that it began
            self.begun = False
            raise self._stopped(ended=True)

    async def _outcome(self) -> Any:
        self._future = self._loop.create_future()
        return await self._future

    def _stopped(self, ended: bool) -> Stopped:
        return Stopped(self.cause or self.halted or ("blocked" if self.blocked else "timeout"), ended)

    def _report(self, value: Any, problem: BaseException | None) -> None:
        """On the event loop: the tool's code has ended. Whatever ending it raises, anyone who waits is notified."""
        try:
            self._end()
        finally:
            self._resolve(value, problem)

    def _resolve(self, value: Any, problem: BaseException | None) -> None:
        future = self._future
        if future is None or future.done():
            return
        if self.cause or isinstance(problem, Interrupted):  # its result after the order to stop came too late
            future.set_exception(self._stopped(ended=True))
        elif problem is not None:
            future.set_exception(client_error(self, problem))
        else:
            future.set_result(value)

    def _end(self) -> None:
        if self.ended:
            return
        self.ended = True
        if self._task is not None or self.inline:
            WATCHDOG.forget(self)
        if self._again is not None:
            self._again.cancel()
        if self.on_end is not None:
            self.on_end()

    def _interrupt(self) -> None:
        if self._job is not None:
            self._job.interrupt()
        elif self._task is not None:
            self._task.cancel()

    def _give_up(self) -> None:
        """The work goes on although it was stopped: its client hears so, and it is tried again."""
        if self._future is not None and not self._future.done():
            self._future.set_exception(self._stopped(ended=False))
        self._again = self._loop.call_later(self.patience.stuck, self._mark)

    def _mark(self) -> None:
        self.stuck = True
        if self.on_stuck is not None:
            self.on_stuck()
        self._try_again()

    def _try_again(self) -> None:
        self._interrupt()
        self._again = self._loop.call_later(self.patience.again, self._try_again)


def guard(tool: FunctionTool) -> None:
    """Replace the tool's function by one that runs it as the work of the current call; outside of a call as it is."""
    if not hasattr(tool.fn, GUARDED):
        tool.fn = guarded(tool.fn, tool.run_in_thread)


def guarded(function: Callable[..., Any], in_thread: bool = True) -> Callable[..., Any]:
    """The same function to its caller, as far as name, signature and documentation go; async unless it runs inline."""
    asynchronous = inspect.iscoroutinefunction(_innermost(function))

    async def in_task(*args: Any, **kwargs: Any) -> Any:
        work = current.get()
        bare = functools.partial(function, *args, **kwargs)
        if work is None:
            return await _collected(bare, math.inf)
        return await work.run_async(functools.partial(_collected, bare, work.bound))

    async def in_worker(*args: Any, **kwargs: Any) -> Any:
        bare = functools.partial(function, *args, **kwargs)
        work = current.get()
        if work is None:
            value = await asyncio.to_thread(bare)
            return await value if inspect.isawaitable(value) else value
        return await work.run(functools.partial(_gathered, work, bare))

    def inline(*args: Any, **kwargs: Any) -> Any:
        work = current.get()
        bare = functools.partial(function, *args, **kwargs)
        if work is None:
            return bare()
        try:
            return work.run_inline(bare)
        except Stopped:
            raise
        except BaseException as problem:
            raise client_error(work, problem) from problem

    if asynchronous or inspect.isasyncgenfunction(function):
        chosen: Any = in_task
    else:
        chosen = in_worker if in_thread else inline
    functools.update_wrapper(chosen, function)
    chosen.__signature__ = inspect.signature(function)
    setattr(chosen, GUARDED, True)
    return chosen  # type: ignore[no-any-return]


def client_error(work: Work, problem: BaseException) -> BaseException:
    """The client's error for an exception of the tool: a message meant for it, or a reference to the server's log."""
    if isinstance(problem, FastMCPError):
        work.reported = problem
        return problem
    if isinstance(problem, MCPError) and problem.error.code == MISSING_REQUIRED_CLIENT_CAPABILITY:
        return problem
    return masked(work, problem)


def masked(work: Work, problem: BaseException) -> ToolError:
    """The error that names nothing but a reference, under which the exception is in the server's log."""
    work.reference = os.urandom(4).hex()
    LOG.error("reference %s: the tool %s failed inside", work.reference, work.tool, exc_info=problem)
    work.reported = error = ToolError(f"the tool failed inside (reference {work.reference})", log_level=logging.DEBUG)
    return error


async def _in_task(work: Work, function: Callable[[], Coroutine[Any, Any, Any]]) -> None:
    """The frame that the watchdog looks for, so that it interrupts nothing but a tool."""
    value, problem = None, None
    try:
        if work.cause or work.halted:  # between the making of the task and its first step
            raise work._stopped(ended=True)
        value = await function()
        _bounded(work, value)
    except BaseException as raised:  # noqa: BLE001 - whatever a tool raises is reported
        problem = raised
    work._report(value, problem)


def _on_loop(work: Work, function: Callable[[], Any]) -> Any:
    """The same for a blocking tool on the event loop."""
    return _gathered(work, function)


FRAMES = frozenset({_in_task.__code__, _on_loop.__code__})


async def _collected(function: Callable[[], Any], bound: float) -> Any:
    """On the event loop: the tool's value, an async generator drawn until it is far too large to be worked on."""
    value = function()
    if not inspect.isasyncgen(value):
        return await value
    drawn: list[Any] = []
    size = 0
    async with aclosing(value):
        async for item in value:
            size = _more(drawn, item, size, bound)
    return drawn


def _more(drawn: list[Any], item: Any, size: int, bound: float) -> int:
    """Keep one more item of a generator; the size of all, TooLarge when that is over the bound."""
    drawn.append(item)
    size += at_least(item, bound)
    if size > bound:
        raise TooLarge(size)
    return size


def _gathered(work: Work, function: Callable[[], Any]) -> Any:
    """In the tool's thread: its value, generators drawn, refused here when it is far too large to be worked on."""
    value = function()
    if inspect.isawaitable(value) and not work.inline:
        value = work.awaited(value)
    if inspect.isgenerator(value):
        drawn: list[Any] = []
        size = 0
        for item in value:
            size = _more(drawn, item, size, work.bound)
        return drawn
    _bounded(work, value)
    return value


def _bounded(work: Work, value: Any) -> None:
    size = at_least(value, work.bound)
    if size > work.bound:
        raise TooLarge(size)


def _innermost(function: Callable[..., Any]) -> Callable[..., Any]:
    while isinstance(function, functools.partial):
        function = function.func
    return function
