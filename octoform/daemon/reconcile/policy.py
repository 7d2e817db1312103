"""When a repair must not be made, whoever judged it right: pure. Light.

An emergency stop is no fault and a person's stop is none, an apply under way is waited for, and nobody repairs what
another repair is just changing.

Which repairs there are for a trouble, how often each may be made, and which are re-discoveries. Light.

Pure: what was tried so far is known by the breakers.
"""

from octoform.daemon.model import Done, Facts, Finding, Kind, Repair
from octoform.daemon.reconcile.lanes import Lane, Task
from octoform.daemon.store.backoff import FLAPS

HARMLESS = frozenset({Repair.ROTATE, Repair.REBIND})
"""Neither starts the endpoint nor changes what it does."""
MOVING = frozenset({Repair.HEAL, Repair.REDISCOVER})
"""May call what moves: never while an emergency stop is latched."""
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
        return "an emergency stop is latched"
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
