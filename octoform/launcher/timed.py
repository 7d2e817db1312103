"""What limits in time say of a call: rates, pauses between calls, quiet hours. An empty text lets it pass."""

from datetime import datetime

from .counters import Used
from .policy import Limit


def rate(tool: str, limit: Limit, used: Used, now: float) -> str:
    """Whether a call is one too many in its time; empty when it is not."""
    recent = [moment for moment in used.calls if now - moment < limit.seconds]
    if len(recent) < limit.calls:
        return ""
    wait = limit.seconds - (now - recent[-limit.calls])
    return (
        f"{tool} was called {len(recent)} times in the last {_seconds(limit.seconds)}; {limit.calls} are allowed "
        f"({limit.source}). The next call is allowed in {_seconds(wait)}."
    )


def cooldown(tool: str, limit: Limit, used: Used, now: float) -> str:
    """Whether a call comes too soon after the last one; empty when it does not."""
    if not used.calls or now - used.calls[-1] >= limit.seconds:
        return ""
    gone = now - used.calls[-1]
    return (
        f"{tool} was called {_seconds(gone)} ago; {_seconds(limit.seconds)} have to lie between two calls "
        f"({limit.source}). The next call is allowed in {_seconds(limit.seconds - gone)}."
    )


def quiet_hours(tool: str, limit: Limit, now: datetime) -> str:
    """Whether a call comes in quiet hours; empty when it does not."""
    minute, begin, end = now.hour * 60 + now.minute, limit.begin, limit.end
    inside = begin <= minute < end if begin < end else minute >= begin or minute < end
    if not inside:
        return ""
    if begin == end:
        return f"{tool} has quiet hours all day ({limit.source})."
    return (
        f"{tool} has quiet hours from {_time(begin)} to {_time(end)} ({limit.source}), and it is {_time(minute)} on "
        f"this host. It is allowed from {_time(end)} on."
    )


def _seconds(value: float) -> str:
    return f"{value:.1f} s" if value % 1 else f"{value:.0f} s"


def _time(minutes: int) -> str:
    return f"{minutes // 60:02d}:{minutes % 60:02d}"
