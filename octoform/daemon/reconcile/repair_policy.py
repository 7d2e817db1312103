"""When a repair must not be made, no matter who judged it right: pure. Light.

An emergency stop is no fault and a person's stop is none, an apply under way is waited for, and no one repairs what
another repair is just changing.

Which repairs there are for a problem, how often each may be made, and which are re-discoveries. Light.

Pure: what was tried so far is known by the breakers.
"""

import threading
import time
import traceback
from collections.abc import Callable
from enum import StrEnum
from typing import Protocol

from octoform.base import shortage
from octoform.claims.model import Reading
from octoform.daemon.model import Done, Facts, Finding, Kind, Repair
from octoform.daemon.store.backoff import FLAPS
from octoform.records import dataclass

# Where repairs are made: beside the loop, so that a long one delays no check.
#
# There is one bench for each kind of work. The endpoint's process can be started again while an agent thinks for
# minutes, and whatever changes what the endpoint stands on is made one after the other. Light.


class Lane(StrEnum):
    """Works that do not wait for each other."""

    PROCESS = "process"
    """The endpoint's process."""
    ROOM = "room"
    """Short work on files of this machine: logs, room, where a device is."""
    STAND = "stand"
    """Repairs of the endpoint's files, and agents: under the state's lock, and long."""
    SENSES = "senses"
    """Readings."""


LANES = {Repair.RESTART: Lane.PROCESS, Repair.ROTATE: Lane.ROOM, Repair.REBIND: Lane.ROOM}


def lane_of(repair: Repair) -> Lane:
    """Where a repair is made."""
    return LANES.get(repair, Lane.STAND)


@dataclass(frozen=True, slots=True)
class Product:
    """The product of a piece of work: the repair's result (None: no repair), and readings after it."""

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
        return Product(Done(ok=False, detail=f"a bug of octoform: {type(bug).__name__}: {bug}"))


HARMLESS = frozenset({Repair.ROTATE, Repair.REBIND})
"""Neither starts the endpoint nor changes what it does."""
MOVING = frozenset({Repair.HEAL, Repair.REDISCOVER})
"""May call what moves: never while an emergency stop is engaged."""
SWAPPING = frozenset(set(Repair) - HARMLESS - {Repair.WATCH, Repair.RESTART})
"""Stop and start the endpoint themselves at the end of their work."""
APPLYING = frozenset({Repair.REDISCOVER, Repair.HEAL})
"""May be at work as an apply, or under another name."""
PROCESS = frozenset({Kind.PROCESS_DEAD, Kind.PROCESS_HUNG, Kind.CRASH_LOOP, Kind.PORT_TAKEN})
GRACE_SECONDS = 15.0
"""How long the endpoint may be away while a repair of ours exchanges it, before it is started again all the same."""


def barred(repair: Repair, facts: Facts, paused: bool, *, ours: bool) -> str | None:
    """Why a repair is not made now; None when it may be. ``ours``: what keeps the state busy is a repair of ours."""
    if paused:
        return "paused by a person"
    if facts.busy is not None and not ours:
        return f"{facts.busy} is under way"
    if facts.stopped_by is not None and repair not in HARMLESS:
        return f"stopped by {facts.stopped_by}"
    if facts.latched and repair in MOVING:
        return "an emergency stop is engaged"
    return None


def busy_with_ours(facts: Facts, tasks: tuple[Task, ...]) -> bool:
    """True when the state is held by a repair of this daemon, so that the process can be judged all the same."""
    task = next((each for each in tasks if each.lane is Lane.STAND), None)
    if facts.busy is None or task is None or task.repair is None:
        return False
    return facts.busy in set(Repair) or task.repair in APPLYING


def concerns_process(kind: Kind, target: str) -> bool:
    """True for what can be judged, and repaired, while a long repair is under way."""
    return kind in PROCESS and target == "endpoint"


def swaps(task: Task, missed: float) -> bool:
    """True for a repair that may have stopped the endpoint on purpose, which was missed at ``missed`` (uptime)."""
    return task.repair in SWAPPING and task.began < missed


PASSIVE = frozenset({Repair.NONE, Repair.WAIT, Repair.PERSON})
QUICK = HARMLESS | {Repair.RESTART}
"""Done in a moment, and cheap: for these the bound of an hour is that of what comes back again and again."""
EVIDENCES = 3
"""How many evidences of one target and class may have all of their tries within an hour."""


def chain_of(finding: Finding) -> tuple[Repair, ...]:
    """The repairs that there are for a finding, in the order in which they are tried."""
    return tuple(repair for repair in (finding.repair, *finding.then) if repair not in PASSIVE)


def limit_of(finding: Finding, most: int) -> int:
    """How many tries there are; fewer where the judge sends for a person after the last of its repairs."""
    return min(most, len(chain_of(finding))) if Repair.PERSON in finding.then else most


def most_in_hour(repair: Repair, most: int) -> int:
    """How many tries one target and class have in an hour, whatever their evidence; ``most`` are those of one."""
    return FLAPS if repair in QUICK else EVIDENCES * most


def rediscovers(repair: Repair | None, done: Done) -> bool:
    """True for a try that was a re-discovery, or a HEAL that asked for one."""
    asked = repair is Repair.HEAL and (done.report or {}).get("action") == Repair.REDISCOVER
    return asked or repair is Repair.REDISCOVER
