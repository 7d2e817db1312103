"""When a repair must not be made, whoever judged it right: pure. Light.

An emergency stop is no fault and a person's stop is none, an apply under way is waited for, and nobody repairs what
another repair is just changing.
"""

from octoform.daemon.loop.bench import Lane, Task
from octoform.daemon.model import Facts, Kind, Repair

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
