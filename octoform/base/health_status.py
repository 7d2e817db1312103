"""The health of a deployment in one word, and when what the daemon wrote of it is believed.

The daemon composes it; the commands that show it and the process at the door, which runs without the core, read the
record. An agent's report and the contract for it use the same words. Standard library only.
"""

from collections.abc import Iterable, Mapping
from enum import StrEnum
from typing import Any

FILE = "health.json"


class Status(StrEnum):
    """Health in one word. ``unknown`` is what cannot report; it is never ``healthy``."""

    HEALTHY = "healthy"
    DEGRADED = "degraded"
    ERROR = "error"
    DOWN = "down"
    UNKNOWN = "unknown"


ORDER = (Status.HEALTHY, Status.UNKNOWN, Status.DEGRADED, Status.ERROR, Status.DOWN)
"""From best to worst: one that is known to be ill is worse than one of which nothing is known."""


def worst(found: Iterable[Status]) -> Status:
    """The worst of these; healthy where there is none."""
    return max(found, key=ORDER.index, default=Status.HEALTHY)


def basis(instance: str | None, *, stopped: bool, engaged: bool) -> dict[str, Any]:
    """What any process can check by itself: which start of the endpoint runs, whether a person stopped it, and whether
    the emergency stop is engaged."""
    return {"instance": instance, "stopped": stopped, "latched": engaged}


def believed(record: Any, now: float, seen: Mapping[str, Any]) -> Status | None:
    """The status in a daemon's record at ``now`` (seconds of CLOCK_BOOTTIME); None where it is not believed: it is of
    another time, or what can be ``seen`` directly (`basis`) contradicts it."""
    try:
        fresh = record["uptime"] <= now <= record["until"]
        return Status(record["status"]) if fresh and record["basis"] == seen else None
    except (LookupError, TypeError, ValueError):
        return None
