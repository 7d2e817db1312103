"""The emergency stop: latch, interrupt, write each device's stop bytes, record. Needs no model, no generated code.

The bytes come from the profiles, the nodes from the runtime's way to find a device by identity. All devices are
written to at once, each in a thread of its own with a bounded time, because one that hangs must not keep the others
moving. No lock of a bus is waited for: whatever holds it may be what has to be stopped. What was interrupted may still
tidy up, and send its device something after the stop bytes: they are written again once its code has ended.
"""

import errno
import importlib
import os
import select
import stat
import termios
import threading
import time
import tty
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from octoform.policy.published import Policy, StopAction
from octoform.server.audit.audit_log import Audit
from octoform.server.latch import Estop, Latch

SECONDS = 2.0
"""Seconds that one stop action may take."""
ENDING = 2.0
"""Seconds that interrupted code has to end in before the answer states that it has not."""
_ENGAGE_WAIT, _CLEAR_WAIT = 0.2, 2.0
_PAUSE, _LATER = 0.005, 0.05

Find = Callable[[str, str], str]
"""Device id and class to the path of the device's node; raises what states that there is none."""


class Running(Protocol):
    """The code of a call that was instructed to stop; ``over`` once none of it runs any more, asked from any thread."""

    tool: str

    @property
    def over(self) -> bool: ...


Interrupt = Callable[[], Sequence[Running]]
"""Orders everything that moves to stop, and returns what got the order."""


@dataclass(frozen=True, slots=True)
class Stopped:
    """The result of one stop action: ``ok`` when the device took all bytes; ``detail`` in words; milliseconds."""

    device: str
    kind: str
    ok: bool
    detail: str
    ms: float


@dataclass(frozen=True, slots=True)
class Emergency:
    """The parts of an emergency stop. ``audit`` is None where the log cannot be opened; ``problems`` states why.

    ``unwritten`` states what it means here when the latch cannot be written.
    """

    latch: Latch
    audit: Audit | None
    actions: tuple[StopAction, ...]
    problems: tuple[str, ...] = ()
    unwritten: str = "the latch could not be written, so it holds in this process alone"

    def stop(
        self, by: str, reason: str, find: "Find | None" = None, interrupt: "Interrupt | None" = None
    ) -> dict[str, Any]:
        """Latch, interrupt what moves, run the stop actions, record, run the actions again as what moved has ended.

        The answer: ``ok`` (engaged, every action done, nothing goes on, nothing wrong), ``latched``, ``estop`` (by,
        reason, since; the first one's where it was engaged already), ``stopped`` (of the last time that each action
        was run), ``problems`` (sentences).
        """
        problems = list(self.problems)
        with _collect_problems(problems, self.unwritten):
            self.latch.engage(by, reason)
        if (why := self.latch.wordless) is not None:
            problems.append(f"the latch is engaged, but has no room for who engaged it and why: {_sentence(why)}")
        running = _interrupted(interrupt, problems)
        act = partial(_begin, self.actions, find or node_of)
        jobs = act()
        with self.latch.held(_ENGAGE_WAIT):
            with suppress(OSError):  # reported above; here it only comes after a clear that was faster
                self.latch.engage(by, reason)
            self._record(problems, "estop", by=by, reason=reason, latched=_words(self.latch.engaged()))
        running.update(_interrupted(interrupt, problems))
        stopped = _outcomes(jobs)
        left, stopped = _again(list(running.values()), act, stopped)
        problems.extend(f"{each.tool} was interrupted, but its code has not ended yet" for each in left)
        self._record(problems, "estop_actions", by=by, stopped=[asdict(item) for item in stopped])
        if left:
            try:
                threading.Thread(target=self._later, args=(left, act, by), name="stop later", daemon=True).start()
            except RuntimeError:  # no more threads
                problems.append("nothing runs the stop actions once more when that ends; ask for the stop again")
        with _collect_problems(problems, "the latch is not on the disk yet"), suppress(FileNotFoundError):
            self.latch.keep()  # a latch that could not be written is reported above
        estop = self.latch.engaged()
        return {
            "ok": estop is not None and all(item.ok for item in stopped) and not problems,
            "latched": estop is not None,
            "estop": _words(estop),
            "stopped": [asdict(item) for item in stopped],
            "problems": problems,
        }

    def _later(self, left: "list[Running]", act: "Callable[[], list[_Job]]", by: str) -> None:
        """No one waits any more, but what ends while the latch is closed ends with the stop bytes."""
        while left and self.latch.engaged() is not None:
            going = [each for each in left if not each.over]
            if len(going) < len(left):
                self._record([], "estop_actions", by=by, stopped=[asdict(item) for item in _outcomes(act())])
            left = going
            time.sleep(_LATER)

    def clear(self, by: str) -> dict[str, Any]:
        """Open the latch, once that is recorded. The answer: ``ok``, ``latched``, ``estop`` (what had engaged it, or
        None), ``problems``."""
        problems = list(self.problems)
        with self.latch.held(_CLEAR_WAIT) as alone:
            estop = self.latch.engaged()
            if not alone:
                opened = alone is not None
                problems.append("another emergency stop is under way" if opened else "its lock file cannot be opened")
            elif estop is not None and self._record(problems, "estop_cleared", by=by, was=_words(estop)):
                with _collect_problems(problems, "the latch could not be removed"):
                    self.latch.clear(by)
            latched = self.latch.engaged() is not None
        if latched:
            problems.append("the emergency stop stays engaged")
        return {"ok": not latched, "latched": latched, "estop": _words(estop), "problems": problems}

    def _record(self, problems: list[str], event: str, **fields: Any) -> bool:
        if self.audit is None:
            return False
        before = len(problems)
        with _collect_problems(problems, "the audit log has no record of it"):
            self.audit.write(event, **fields)
        return len(problems) == before


def _interrupted(interrupt: "Interrupt | None", problems: list[str]) -> "dict[int, Running]":
    try:
        return {id(each): each for each in interrupt()} if interrupt is not None else {}
    except Exception as problem:  # noqa: BLE001 - the stop goes on, and this is reported
        problems.append(f"what ran could not be interrupted: {_sentence(problem)}")
        return {}


def _again(
    left: "list[Running]", act: "Callable[[], list[_Job]]", stopped: list[Stopped]
) -> tuple["list[Running]", list[Stopped]]:
    """Run the actions once more whenever something has ended; what has not ended in time, and what came of it last."""
    deadline = time.monotonic() + ENDING
    while left:
        going = [each for each in left if not each.over]
        if len(going) < len(left):
            stopped = _outcomes(act())
        elif time.monotonic() >= deadline:
            break
        else:
            time.sleep(_PAUSE)
        left = going
    return left, stopped


def run(policy: Policy, find: "Find | None" = None, seconds: float = SECONDS) -> list[Stopped]:
    """Run all stop actions of a policy at once; what came of each, in the policy's order, within ``seconds`` each."""
    return _outcomes(_begin(policy.stop, find or node_of), seconds)


def node_of(device: str, kind: str) -> str:
    """The node of a device as the runtime finds it now; its faults say what is missing.

    Of several equal devices in doubt it takes the one that the ordinal states: stop bytes hold for the kind, so
    stopping one too many is better than none.
    """
    runtime = importlib.import_module("runtime")
    return str(runtime.device(device).node(kind))


@dataclass(slots=True)
class _Job:
    """One action under way. ``doing`` states how far it came, for the case that it never ends."""

    action: StopAction
    doing: str = "waiting for the device's other stop action"
    begun: float = field(default_factory=time.monotonic)
    ended: threading.Event = field(default_factory=threading.Event)
    outcome: Stopped | None = None


def _begin(actions: Sequence[StopAction], find: Find) -> list[_Job]:
    """Start all actions; those of one device run one after the other, in the order given."""
    jobs = [_Job(action) for action in actions]
    devices: dict[str, list[_Job]] = {}
    for job in jobs:
        devices.setdefault(job.action.device, []).append(job)
    for device, mine in devices.items():
        try:
            threading.Thread(target=_work, args=(mine, find), name=f"stop {device}", daemon=True).start()
        except RuntimeError:  # no more threads; the writes are bounded by themselves
            _work(mine, find)
    return jobs


def _outcomes(jobs: list[_Job], seconds: float = SECONDS) -> list[Stopped]:
    deadline = time.monotonic() + seconds * max((_turn(job, jobs) for job in jobs), default=0)
    stopped = []
    for job in jobs:
        job.ended.wait(max(0.0, deadline - time.monotonic()))
        if job.outcome is None:
            stopped.append(_ended(job, False, f"not done after {_since(job) / 1000:.1f} s: {job.doing}"))
        else:
            stopped.append(job.outcome)
    return stopped


def _turn(job: _Job, jobs: list[_Job]) -> int:
    return sum(1 for other in jobs if other.action.device == job.action.device)


def _work(jobs: list[_Job], find: Find) -> None:
    for job in jobs:
        job.begun = time.monotonic()
        try:
            detail = _one(job, find)
            job.outcome = _ended(job, True, detail)
        except Exception as problem:  # noqa: BLE001 - whatever finding or writing raises, it is reported
            job.outcome = _ended(job, False, _sentence(problem))
        job.ended.set()


def _one(job: _Job, find: Find) -> str:
    action = job.action
    job.doing = "looking for the device"
    node = find(action.device, action.kind)
    job.doing = f"opening {node}"
    descriptor, shared = _open(node)
    try:
        if action.baud is not None:
            job.doing = f"setting the line of {node}"
            _set_line(descriptor, action.baud)
        job.doing = f"writing to {node}"
        _write(descriptor, action.write, job.begun + SECONDS)
        if os.isatty(descriptor):
            job.doing = f"{node} has the bytes, but has not sent them"
            termios.tcdrain(descriptor)
    finally:
        os.close(descriptor)
    way = " on the line that this process has open" if shared else ""
    return f"wrote {len(action.write)} bytes to {node}{way}"


def _open(node: str) -> tuple[int, bool]:
    """A descriptor of the node, and whether it is one that this process had: an exclusive line opens only once."""
    status = Path(node).stat()
    if not stat.S_ISCHR(status.st_mode):
        raise OSError(errno.ENOTTY, "it is no character device", node)
    try:
        # Without waiting for a carrier, and never as the controlling terminal.
        return os.open(node, os.O_RDWR | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC), False
    except OSError as problem:
        held = _held(status.st_rdev)
        if held is None:
            raise problem
        return held, True


def _held(device: int) -> int | None:
    """A copy of a writable descriptor of this process for a character device; None when it has none."""
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # closed meanwhile
            number = int(entry.name)
            status = os.fstat(number)
            if not stat.S_ISCHR(status.st_mode) or status.st_rdev != device:
                continue
            copy = os.dup(number)
            if os.fstat(copy).st_rdev == device and _writable(copy):
                return copy
            os.close(copy)
    return None


def _writable(descriptor: int) -> bool:
    flags = Path(f"/proc/self/fdinfo/{descriptor}").read_text().partition("flags:")[2].split()[0]
    return int(flags, 8) & os.O_ACCMODE != os.O_RDONLY


def _set_line(descriptor: int, baud: int) -> None:
    """Raw, at this rate, without waiting for modem lines; OSError for a rate that the system has no name for."""
    speed = getattr(termios, f"B{baud}", None)
    if speed is None:
        raise OSError(errno.EINVAL, f"{baud} is no rate that this system can set")
    tty.setraw(descriptor, termios.TCSANOW)
    mode = termios.tcgetattr(descriptor)
    mode[2] |= termios.CLOCAL | termios.CREAD
    mode[4] = mode[5] = speed
    termios.tcsetattr(descriptor, termios.TCSANOW, mode)


def _write(descriptor: int, data: bytes, deadline: float) -> None:
    """All bytes, or an error: TimeoutError when the device takes no more."""
    ready = select.poll()
    ready.register(descriptor, select.POLLOUT)
    left = memoryview(data)
    while left:
        found = ready.poll(max(0.0, deadline - time.monotonic()) * 1000)
        if found and not found[0][1] & select.POLLOUT:
            raise OSError(errno.EIO, "the device went away")
        if time.monotonic() >= deadline:
            raise TimeoutError(
                f"the device took only {len(data) - len(left)} of {len(data)} bytes within {SECONDS:g} s"
            )
        try:
            left = left[os.write(descriptor, left) :]
        except BlockingIOError:
            time.sleep(_PAUSE)  # a line signals room before it has enough


def _ended(job: _Job, ok: bool, detail: str) -> Stopped:
    return Stopped(job.action.device, job.action.kind, ok, detail, round(_since(job), 1))


def _since(job: _Job) -> float:
    return (time.monotonic() - job.begun) * 1000


def _words(estop: Estop | None) -> Mapping[str, str] | None:
    return None if estop is None else asdict(estop)


def _sentence(problem: BaseException) -> str:
    if isinstance(problem, OSError) and problem.strerror:
        return f"{problem.filename}: {problem.strerror}" if problem.filename else problem.strerror
    return str(problem) or type(problem).__name__


class _collect_problems:
    """Inside this an OSError becomes a sentence among the problems: an emergency stop goes on."""

    def __init__(self, problems: list[str], text: str) -> None:
        self._problems, self._text = problems, text

    def __enter__(self) -> None:
        return None

    def __exit__(self, _: object, problem: BaseException | None, __: object) -> bool:
        if not isinstance(problem, OSError):
            return False
        self._problems.append(f"{self._text}: {_sentence(problem)}")
        return True
