"""One line when a tool is called and one when it ended, whatever happened in between.

A call that is not in the log is invisible to anyone who watches the server, so the wrapper is around every tool. Lines
are ASCII JSON with bounded text, each written at once to a file opened for appending: calls of several threads and
processes never mix. A log that cannot be written never fails a call; it is stated once on standard error.
"""

import functools
import inspect
import json
import math
import os
import sys
import time
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path, PosixPath
from typing import Any, ParamSpec, TypeVar, cast

from .base.clock import stamp
from .faults import DeviceFault, sentence

# What one call of a tool asked of the host: the devices that it looked for, and the numbers that it read of them.
#
# The call log has it with the call's result. So a result can be compared with what the kernel returned: a tool that
# asks for no device, or that gives the same number while the attribute it reads has moved, reports a wrong value.

MAX_ENTRIES = 8
"""Devices and numbers that are kept of one call."""


@dataclass
class Trace:
    """``devices`` are the ids in the order in which they were asked for, ``raw`` numbers by folder and attribute."""

    devices: list[str] = field(default_factory=list)
    raw: dict[str, float] = field(default_factory=dict)


_current: ContextVar[Trace | None] = ContextVar("trace", default=None)


@contextmanager
def traced() -> Iterator[Trace]:
    """Trace the devices that the code inside asks for, as far as it asks in this thread or task."""
    trace = Trace()
    token = _current.set(trace)
    try:
        yield trace
    finally:
        _current.reset(token)


@contextmanager
def asking(device: str) -> Iterator[None]:
    """A device is looked for; what is read meanwhile shows where it is, and nothing of what it measures."""
    trace = _current.get()
    if trace is not None and device not in trace.devices and len(trace.devices) < MAX_ENTRIES:
        trace.devices.append(device)
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def read(path: Path, text: str | bytes) -> None:
    """An attribute was read; it is kept where it is a number."""
    trace = _current.get()
    if trace is None or len(trace.raw) >= MAX_ENTRIES or len(text) > 64:
        return
    try:
        number = float(text)
    except ValueError:
        return
    if math.isfinite(number):
        trace.raw[f"{path.parent.name}/{path.name}"] = number


class Folder(PosixPath):
    """A folder of attributes; what is read of the paths below it is in the trace."""

    def read_text(self, *arguments: Any, **options: Any) -> str:
        """As of every path."""
        text = super().read_text(*arguments, **options)
        read(self, text)
        return text

    def read_bytes(self) -> bytes:
        """As of every path."""
        data = super().read_bytes()
        read(self, data)
        return data


P = ParamSpec("P")
R = TypeVar("R")

TEXT_CHARS = 200
LINE_CHARS = 4000
_complained: list[str] = []


def logged(tool: Callable[P, R]) -> Callable[P, R]:
    """Log every call of a sync or async tool; its name, signature and documentation stay.

    The result's line names the devices that were asked for and the numbers that were read of them; that of a failed
    call names the class of the exception. A fault of a device, an error of the operating system and a
    missing library then go on as FastMCP's ToolError with one sentence for the client, which a server that masks the
    details of unforeseen errors lets through; without FastMCP, and for every other exception, as they are.
    """
    signature = inspect.signature(tool)

    @functools.wraps(tool)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        entry = _begin(tool.__name__, signature, args, kwargs)
        with traced() as seen:
            try:
                value = tool(*args, **kwargs)
            except BaseException as problem:
                _end(entry, seen, problem)
                if (found := for_client(problem)) is None:
                    raise
                raise found from problem
        _end(entry, seen, None)
        return value

    @functools.wraps(tool)
    async def call_async(*args: P.args, **kwargs: P.kwargs) -> Any:
        entry = _begin(tool.__name__, signature, args, kwargs)
        with traced() as seen:
            try:
                value = await cast("Awaitable[Any]", tool(*args, **kwargs))
            except BaseException as problem:
                _end(entry, seen, problem)
                if (found := for_client(problem)) is None:
                    raise
                raise found from problem
        _end(entry, seen, None)
        return value

    wrapper: Any = call_async if inspect.iscoroutinefunction(tool) else call
    wrapper.__signature__ = signature
    return cast("Callable[P, R]", wrapper)


def for_client(problem: BaseException) -> Exception | None:
    """The error that a client may read for what is no fault of the call; None for every other exception."""
    if isinstance(problem, OSError):
        text = sentence(problem)
    elif isinstance(problem, ImportError):
        text = f"a library that this tool needs is missing on this host: {problem.name or problem}"
    elif isinstance(problem, DeviceFault):
        text = str(problem)
    else:
        return None
    kind = getattr(sys.modules.get("fastmcp.exceptions"), "ToolError", None)
    return kind(text) if isinstance(kind, type) and issubclass(kind, Exception) else None


def _begin(
    name: str, signature: inspect.Signature, args: tuple[Any, ...], kwargs: Mapping[str, Any]
) -> tuple[str, str, float]:
    identity = os.urandom(8).hex()
    try:
        arguments = {key: _bounded(value) for key, value in signature.bind(*args, **kwargs).arguments.items()}
    except TypeError:  # the call itself will say what is wrong with its arguments
        arguments = {}
    _write({"event": "call", "id": identity, "time": stamp(digits=3), "tool": name, "arguments": arguments})
    return identity, name, time.perf_counter()


def _end(entry: tuple[str, str, float], seen: Trace, problem: BaseException | None) -> None:
    identity, name, begun = entry
    line: dict[str, Any] = {
        "event": "result",
        "id": identity,
        "time": stamp(digits=3),
        "tool": name,
        "ok": problem is None,
    }
    if problem is not None:
        line["error"] = type(problem).__name__
        line["message"] = _cut(str(problem))
    line["ms"] = round((time.perf_counter() - begun) * 1000, 1)
    line.update({name: found for name, found in (("devices", seen.devices), ("raw", seen.raw)) if found})
    _write(line)


def _bounded(value: Any) -> Any:
    if value is None or isinstance(value, bool | int | float):
        return value
    return _cut(value if isinstance(value, str) else repr(value))


def _cut(text: str) -> str:
    return text if len(text) <= TEXT_CHARS else f"{text[:TEXT_CHARS]}... ({len(text)} characters)"


def _write(line: dict[str, Any]) -> None:
    text = json.dumps(line, ensure_ascii=True)
    if len(text) > LINE_CHARS and "arguments" in line:
        text = json.dumps({**line, "arguments": {"...": f"{len(line['arguments'])} arguments omitted"}})
    data = text.encode("ascii") + b"\n"
    place = os.environ.get("OCTOFORM_CALL_LOG")
    try:
        if not place:
            sys.stderr.write(data.decode("ascii"))
            return
        # Not blocking: with a pipe in its place every tool would wait for a reader, those that stop a movement too.
        how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_CLOEXEC | os.O_NONBLOCK
        descriptor = os.open(place, how, 0o600)
        try:
            os.write(descriptor, data)
        finally:
            os.close(descriptor)
    except (OSError, ValueError) as problem:
        _complain(f"the call log {place or 'on standard error'} cannot be written: {problem}")


def _complain(text: str) -> None:
    """Say once per process that calls are not being logged."""
    if text in _complained:
        return
    _complained.append(text)
    try:
        print(f"runtime: {text}", file=sys.stderr)
    except (OSError, ValueError):
        return
