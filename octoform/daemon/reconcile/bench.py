"""Where repairs are made: beside the loop, so that a long one delays no check. Light.

There is one bench for each kind of work. The endpoint's process can be started again while an agent thinks for
minutes, and whatever changes what the endpoint stands on is made one after the other.
"""

import threading
import time
import traceback
from collections.abc import Callable
from typing import Protocol

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base import shortage
from octoform.claims.model import Reading
from octoform.daemon.model import Facts, Finding, Kind, Repair
from octoform.daemon.repair.playbook import PLAYBOOK, Lane
from octoform.records import dataclass


@dataclass(frozen=True, slots=True)
class Product:
    """The product of a piece of work: what became of the repair (None: it is none), and readings after it."""

    outcome: RepairOutcome | None
    readings: tuple[Reading, ...] = ()


Work = Callable[[], Product]


@dataclass(frozen=True, slots=True)
class Task:
    """A work under way or ended; ``finding``, ``repair`` and what was ``decided`` are None for mere readings.

    ``key`` counts the tries, ``began`` is the uptime at its beginning.
    """

    lane: Lane
    finding: Finding | None
    repair: Repair | None
    key: str
    decided: RepairOutcome | None
    began: float


@dataclass(frozen=True, slots=True)
class Ended:
    """A work that came to its end; ``seconds`` it took."""

    task: Task
    product: Product
    seconds: float


class Bench(Protocol):
    """Does one work at a time in each lane."""

    def begin(self, task: Task, work: Work) -> None:
        """Begin a work in a lane that is free."""

    def under_way(self) -> tuple[Task, ...]:
        """What has not ended."""

    def ended(self) -> tuple[Ended, ...]:
        """What ended since the last time."""

    def waiting(self) -> bool:
        """True when something ended that no one has asked for yet."""


class Beside:
    """Does each work in a thread of its own, and calls ``rouse`` at its end."""

    def __init__(self, rouse: Callable[[], None]) -> None:
        self._rouse = rouse
        self._guard = threading.Lock()
        self._tasks: dict[Lane, Task] = {}
        self._threads: dict[Lane, threading.Thread] = {}
        self._ended: list[Ended] = []

    def begin(self, task: Task, work: Work) -> None:
        """Begin a work in a lane that is free."""
        with self._guard:
            assert task.lane not in self._tasks
            self._tasks[task.lane] = task
        thread = threading.Thread(target=self._do, args=(task, work), name=f"octoform-{task.lane}", daemon=True)
        try:
            shortage.start(thread)
        except BlockingIOError:
            with self._guard:
                self._tasks.pop(task.lane, None)
                self._ended.append(Ended(task, Product(RepairOutcome.failed("loop.shortage", shortage.TEXT)), 0.0))
            self._rouse()
            return
        self._threads[task.lane] = thread

    def under_way(self) -> tuple[Task, ...]:
        """What has not ended."""
        with self._guard:
            return tuple(self._tasks.values())

    def ended(self) -> tuple[Ended, ...]:
        """What ended since the last time."""
        with self._guard:
            found, self._ended = tuple(self._ended), []
        return found

    def waiting(self) -> bool:
        """True when something ended that no one has asked for yet."""
        with self._guard:
            return bool(self._ended)

    def join(self, seconds: float) -> bool:
        """Wait for what is under way, at most so long; True when nothing is any more."""
        end = time.monotonic() + seconds
        for thread in list(self._threads.values()):
            thread.join(max(0.0, end - time.monotonic()))
        return not self.under_way()

    def _do(self, task: Task, work: Work) -> None:
        began = time.monotonic()
        product = done(work)
        with self._guard:
            self._tasks.pop(task.lane, None)
            self._ended.append(Ended(task, product, time.monotonic() - began))
        self._rouse()


class AtOnce:
    """Does each work where it is begun: for virtual time."""

    def __init__(self, uptime: Callable[[], float]) -> None:
        self._uptime = uptime
        self._ended: list[Ended] = []

    def begin(self, task: Task, work: Work) -> None:
        """Do a work."""
        began = self._uptime()
        product = done(work)
        self._ended.append(Ended(task, product, self._uptime() - began))

    def under_way(self) -> tuple[Task, ...]:
        """What no one has asked for yet keeps its lane, as it would beside the loop."""
        return tuple(item.task for item in self._ended)

    def ended(self) -> tuple[Ended, ...]:
        """What ended since the last time."""
        found, self._ended = tuple(self._ended), []
        return found

    def waiting(self) -> bool:
        """True when something ended that no one has asked for yet."""
        return bool(self._ended)


def done(work: Work) -> Product:
    """The result of a piece of work; a bug in it becomes a failed repair, with its traceback in the log."""
    try:
        return work()
    except Exception as bug:  # noqa: BLE001 - it is reported, and the loop goes on
        traceback.print_exception(bug)
        return Product(RepairOutcome.failed("loop.bug", f"a bug of octoform: {type(bug).__name__}: {bug}"))


PROCESS = frozenset({Kind.PROCESS_DEAD, Kind.PROCESS_HUNG, Kind.CRASH_LOOP, Kind.PORT_TAKEN})
GRACE_SECONDS = 15.0
"""How long the endpoint may be away while a repair of ours exchanges it, before it is started again all the same."""


def busy_with_ours(facts: Facts, tasks: tuple[Task, ...]) -> bool:
    """True when the state is held by a repair of this daemon, so that the process can be judged all the same."""
    task = next((each for each in tasks if each.lane is Lane.STAND), None)
    if facts.busy is None or task is None or task.repair is None:
        return False
    return facts.busy in set(Repair) or PLAYBOOK[task.repair].moves


def concerns_process(kind: Kind, target: str) -> bool:
    """True for what can be judged, and repaired, while a long repair is under way."""
    return kind in PROCESS and target == "endpoint"


def swaps(task: Task, missed: float) -> bool:
    """True for a repair that may have stopped the endpoint on purpose, which was missed at ``missed`` (uptime)."""
    return task.repair is not None and PLAYBOOK[task.repair].exchanges and task.began < missed
