"""The values of the daemon: facts, findings, repairs, memory. Light: nothing here opens a file or reads a clock.

One check cycle is always the same: *facts* are looked at, *findings* are judged from them, each finding has at most one
*repair*, and what a repair was worth is seen from the next facts, never from its own word. All check cycles of one
problem are one *incident*.
"""

from collections.abc import Callable, Iterable, Mapping
from enum import StrEnum
from typing import Any, Protocol

from octoform.apply.repair_outcome import RepairOutcome
from octoform.base.digest import of_value, short
from octoform.base.health_status import Status
from octoform.claims.model import Reading, Signal
from octoform.endpoint.logs import LoggedCall
from octoform.endpoint.process.record import Running
from octoform.records import dataclass, field, replace


class Cause(StrEnum):
    """Why a check cycle is made. Everything but ``interval`` and ``retry`` is an event; these two are the fallback."""

    START = "start"
    PROCESS = "process"
    """The endpoint's process ended, or another one took its place."""
    HARDWARE = "hardware"
    """The kernel announced hot-plug."""
    LOG = "log"
    """There are new lines in a log."""
    FILES = "files"
    """Something the endpoint stands on was written, moved or removed."""
    PING = "ping"
    """It was time to ask the endpoint whether it answers."""
    INTERVAL = "interval"
    RETRY = "retry"
    """A repair that waited for its time may be tried again."""
    RESUMED = "resumed"
    """The machine was suspended, or its wall clock jumped."""
    ASKED = "asked"
    """A person asked for it: ``resume``, ``heal -retry``."""


class FaultClass(StrEnum):
    """The playbook's closed classes (the paper, section 3.5); ``none`` is for a person."""

    DEPENDENCY = "dependency"
    BROKEN_TOOL = "broken_tool"
    CORRUPTED_FILE = "corrupted_file"
    DEAD_PROCESS = "dead_process"
    DEVICE_MOVED = "device_moved"
    NONE = "none"


class Kind(StrEnum):
    """The fault classes that code can determine; finer than the playbook's classes."""

    PROCESS_DEAD = "process_dead"
    PROCESS_HUNG = "process_hung"
    CRASH_LOOP = "crash_loop"
    PACKAGE_DAMAGED = "package_damaged"
    PACKAGE_CONFLICT = "package_conflict"
    DEVICE_MOVED = "device_moved"
    DEVICE_GONE = "device_gone"
    DEVICE_BACK = "device_back"
    DEVICE_DOUBTFUL = "device_doubtful"
    """Several candidates, and none is certainly the device: never re-bound."""
    FILE_DAMAGED = "file_damaged"
    PORT_TAKEN = "port_taken"
    DISK_FULL = "disk_full"
    LOG_OVERGROWN = "log_overgrown"
    HARDWARE_CHANGED = "hardware_changed"
    """Kinds of hardware appeared or went that PROBE did not see: re-discovery."""
    TOOL_FAILING = "tool_failing"
    """Calls fail for a reason that code does not know: WATCH is asked."""
    BEYOND_LIMIT = "beyond_limit"
    """After a call a device reported a unit outside of its range, so nothing moves that unit: a person looks at it."""
    PICTURE_ODD = "picture_odd"
    TUNNEL_DOWN = "tunnel_down"
    STATE_DAMAGED = "state_damaged"
    """A problem that the daemon may not repair by itself: a state, a manifest or a setting for a person."""
    UNCOVERED = "uncovered"
    """Something that should report does not."""


class Repair(StrEnum):
    """The repairs of a finding; a closed list. ``person`` means that nothing is, and that it is escalated."""

    NONE = "none"
    RESTART = "restart"
    REBUILD = "rebuild"
    """Build the serving environment from its lock again."""
    RESTORE = "restore"
    """Put the accepted artifact back."""
    REPUBLISH = "republish"
    """Write the endpoint's own files again, and check it."""
    REBIND = "rebind"
    """Write down where a device is now; tools find it at their next call in any case."""
    ROTATE = "rotate"
    REDISCOVER = "rediscover"
    WATCH = "watch"
    HEAL = "heal"
    ROLL_BACK = "roll_back"
    """Take back what HEAL changed, because the readings after it are worse."""
    WAIT = "wait"
    """Only the world can fix it (a device that was pulled): reported once, closed when it is over."""
    PERSON = "person"


class Outcome(StrEnum):
    """How an incident stands or ended."""

    OPEN = "open"
    REPAIRED = "repaired"
    CLEARED = "cleared"
    """It went away without a repair of ours."""
    FROZEN = "frozen"
    """Three tries did not help; a person is needed."""
    SURFACED = "surfaced"
    """No playbook entry: a person is needed."""


ANY = ("whatever it says",)
"""The evidence of all problems of one target and class."""


@dataclass(frozen=True, slots=True)
class LastSeen:
    """Where a device is: ``there`` is None when that cannot be determined. ``place`` is its place in sysfs (instance).

    ``recorded`` is the place that the ledger of instances has for it, in the same form (None: none is written down).
    ``refused`` is a sentence on a node of it that this user may not use.
    """

    there: bool | None
    place: str | None = None
    doubt: str | None = None
    recorded: str | None = None
    refused: str | None = None


@dataclass(frozen=True, slots=True)
class Facts:
    """One look at a deployment; what was not looked at is None or empty, and never taken for good.

    ``uptime`` is in seconds of CLOCK_BOOTTIME, ``stamp`` RFC 3339. ``busy`` names the operation of a live holder of the
    state's lock (``apply``), while which nothing is judged. ``stopped_by`` is set when a person stopped the endpoint.
    ``endpoint`` are the reasons of `octoform.endpoint.drift`, ``damaged`` are paths below the project with
    ``missing``, ``changed``, ``link`` or ``foreign``. ``environment`` are the reasons of
    `octoform.endpoint.environment.model.intact`.
    ``appeared`` and ``gone`` are fingerprint entries against the last accepted PROBE. ``failures`` and ``worked`` are
    calls since the last look, ``printed`` new lines of the process's own log that are no access lines (bounded).
    ``start_failed`` is the message of our last start when it failed. Sizes are in bytes. ``put_off`` are causes
    whose look was cut short because the endpoint's process ended: they are looked at again, right after that.
    """

    uptime: float
    stamp: str
    host: str
    applied: bool = True
    destroyed: bool = False
    """True when the state confirms that nothing is applied, so that no endpoint was lost."""
    busy: str | None = None
    stopped_by: str | None = None
    process: Running | None = None
    answers: bool | None = None
    reported: Mapping[str, Any] | None = None
    latched: bool = False
    unproved: tuple[str, ...] = ()
    """Privileged steps whose hardware test failed when they were last applied."""
    offered: frozenset[str] = frozenset()
    """The endpoint's tools by name; empty where that is not known."""
    endpoint: tuple[str, ...] = ()
    damaged: Mapping[str, str] = field(default_factory=dict)
    environment: tuple[str, ...] = ()
    disk_free: int | None = None
    log_bytes: Mapping[str, int] = field(default_factory=dict)
    appeared: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    devices: Mapping[str, LastSeen] = field(default_factory=dict)
    failures: tuple[LoggedCall, ...] = ()
    worked: tuple[str, ...] = ()
    printed: tuple[str, ...] = ()
    start_failed: str | None = None
    put_off: frozenset[Cause] = frozenset()


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that is wrong.

    ``target`` names it for a person and a program: ``endpoint``, ``tool:camera_capture``, ``device:usb-045e-0772``,
    ``file:state/bench/serve/server.py``, ``package:opencv-python``, ``hardware``, ``disk``, ``log:octoform.jsonl``.
    ``evidence`` is what does not change from one look to the next as long as it is the same problem: no time, no pid,
    no counter. ``repair`` is the first one to be tried, ``then`` the ones after it failed.
    """

    kind: Kind
    fault: FaultClass
    target: str
    summary: str
    evidence: tuple[str, ...]
    repair: Repair
    then: tuple[Repair, ...] = ()
    status: Status = Status.DEGRADED
    detail: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)

    @property
    def key(self) -> str:
        """The key of a retry budget: target, class and a digest of the evidence."""
        return f"{self.target} {self.fault} {short(of_value(list(self.evidence)))}"

    @property
    def broadly(self) -> "Finding":
        """The same whatever its evidence is: for a target and class that are given up as a whole."""
        return replace(self, evidence=ANY)


@dataclass(frozen=True, slots=True)
class Alert:
    """An alert to a person: an incident that opened, was repaired, froze, or waits for them."""

    event: str
    """One of ``opened``, ``repaired``, ``cleared``, ``frozen``, ``surfaced``, ``confirm``, ``asks``."""
    host: str
    target: str
    summary: str
    stamp: str
    hint: str = ""


# What the daemon's loop asks of the world, by role: tests put their own behind each, the composition the real ones.


class Clock(Protocol):
    """Time: seconds that only rise and go on while the machine sleeps (CLOCK_BOOTTIME), and wall time for stamps."""

    def uptime(self) -> float:
        """Seconds since the machine was started."""

    def stamp(self) -> str:
        """RFC 3339 in UTC."""


class Sources(Protocol):
    """Where events come from."""

    def wait(self, seconds: float | None) -> frozenset[Cause]:
        """Wait for events, at most so long; empty when the time is over. A burst of them comes as one."""

    def rouse(self) -> None:
        """Let a wait return now, or the next one; may be called by another thread or a signal's handler."""

    def follow(self, facts: Facts) -> None:
        """Listen to what these facts name: the process that runs now, the files that are there."""

    def close(self) -> None:
        """Let go of everything."""


class Look(Protocol):
    """Looks at the deployment; cheap, and only as far as ``causes`` make it worth while."""

    def __call__(self, causes: frozenset[Cause]) -> Facts:
        """The facts; what is not looked at for these causes is as it was at the last look."""


class Repairer(Protocol):
    """Carries out one repair; blocking, bounded in time, and never raises for what the world does."""

    def __call__(self, finding: Finding, repair: Repair, /) -> RepairOutcome:
        """Do it once."""


Sample = Callable[[], Iterable[Reading]]
"""Fresh readings of one channel; what cannot be read is a reading of ``None``, never omitted."""
Promised = Callable[[], frozenset[Signal]]
"""The expected signals: each reading tool, and the camera where it may be looked through; without a path."""
Notify = Callable[[Alert], None]


@dataclass(frozen=True, slots=True)
class Ports:
    """Everything that the loop needs of the world."""

    clock: Clock
    sources: Sources
    look: Look
    repair: Repairer
    sample: Sample
    promised: Promised
    notify: Notify
