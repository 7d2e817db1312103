"""Where repairs are made: beside the loop, so that a long one blinds nobody.

There is one bench for each kind of work. The endpoint's process can be started again while an agent thinks for minutes,
and whatever changes what the endpoint stands on is made one after the other. Light.
"""

import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from octoform.base import shortage
from octoform.claims.model import Reading
from octoform.daemon.model import Done, Finding, Repair


class Lane(StrEnum):
    """Works that do not wait for each other."""

    PROCESS = "process"
    """The endpoint's process."""
    ROOM = "room"
    """Short work on files of this machine: logs, room, where a device is."""
    STAND = "stand"
    """What the endpoint stands on, and agents: under the state's lock, and long."""
    SENSES = "senses"
    """Readings."""


LANES = {Repair.RESTART: Lane.PROCESS, Repair.ROTATE: Lane.ROOM, Repair.REBIND: Lane.ROOM}


def lane_of(repair: Repair) -> Lane:
    """Where a repair is made."""
    return LANES.get(repair, Lane.STAND)


@dataclass(frozen=True, slots=True)
class Product:
    """What a work made: what became of the repair (None: it was no repair), and readings that were taken after it."""

    done: Done | None
    readings: tuple[Reading, ...] = ()


Work = Callable[[], Product]


@dataclass(frozen=True, slots=True)
class Task:
    """A work under way or ended; ``finding`` and ``repair`` are None for mere readings. ``key`` counts the tries."""

    lane: Lane
    finding: Finding | None
    repair: Repair | None
    key: str
    stamp: str
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
        """True when something ended that nobody has asked for yet."""


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
                self._ended.append(Ended(task, Product(Done(ok=False, detail=shortage.TEXT)), 0.0))
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
        """True when something ended that nobody has asked for yet."""
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
        """What nobody has asked for yet keeps its lane, as it would beside the loop."""
        return tuple(item.task for item in self._ended)

    def ended(self) -> tuple[Ended, ...]:
        """What ended since the last time."""
        found, self._ended = tuple(self._ended), []
        return found

    def waiting(self) -> bool:
        """True when something ended that nobody has asked for yet."""
        return bool(self._ended)


def done(work: Work) -> Product:
    """What a work made; a bug in it is told as a repair that failed, with its traceback for whoever reads the log."""
    try:
        return work()
    except Exception as bug:  # noqa: BLE001 - it is told, and the loop lives on
        traceback.print_exception(bug)
        return Product(Done(ok=False, detail=f"a bug of octoform: {type(bug).__name__}: {bug}"))
