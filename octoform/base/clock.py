"""The time, the machine's uptime, and the text form of a moment.

A moment of the wall clock is written in one form (RFC 3339 in UTC, ``2026-05-04T12:00:00Z``) and read in every form of
ISO 8601. A length of time is measured by `boottime`, which goes on while the machine sleeps and never jumps; it means
nothing after the next start of the machine, which `boot_id` names. Standard library only, from Python 3.10 on.
"""

import re
import time
from collections.abc import Callable
from datetime import datetime, timedelta, timezone, tzinfo
from pathlib import Path

_UTC = timezone.utc  # noqa: UP017 - the copy beside a server runs on Python 3.10, which has no other name for it
Clock = Callable[[], float]
"""Seconds, never going back; ``time.monotonic`` is one. A test's own makes a minute pass at once."""
_LEAP = r"(:\d\d):60(?=\D|$)"


def stamp(moment: float | datetime | None = None, digits: int = 0) -> str:
    """A moment (None: now) as RFC 3339 in UTC, cut to so many digits of a second; a naive one is local time.

    ValueError or OverflowError for one that no calendar has.
    """
    if isinstance(moment, datetime):  # exactly: a float has no thousandths of a second
        whole, micro = int(moment.replace(microsecond=0).timestamp()), moment.microsecond
    else:
        whole, micro = divmod(round((time.time() if moment is None else moment) * 1_000_000), 1_000_000)
    fraction = f".{micro:06d}"[: digits + 1] if digits else ""
    return time.strftime("%Y-%m-%dT%H:%M:%S", time.gmtime(whole)) + fraction + "Z"


def parse_stamp(text: object, zone: tzinfo | None = _UTC) -> datetime | None:
    """The moment that a string names, in ``zone`` where it names none (None: it stays naive); None for all else."""
    if not isinstance(text, str):
        return None
    # A leap second is the one after it.
    written, leap = re.subn(_LEAP, r"\1:59", text, count=1) if ":60" in text else (text, 0)
    try:
        moment = datetime.fromisoformat(written) + timedelta(seconds=leap)
    except (ValueError, OverflowError):
        return None
    return moment if moment.tzinfo is not None else moment.replace(tzinfo=zone)


def epoch(text: object, zone: tzinfo | None = _UTC) -> float | None:
    """Seconds since 1970 of the moment that a string names, by local time where no zone is named; None for all else."""
    moment = parse_stamp(text, zone)
    try:
        return None if moment is None else moment.timestamp()
    except (ValueError, OverflowError):
        return None


def boottime() -> float:
    """Seconds since the machine was started, those of its sleep counted; without them where no clock counts those."""
    clock = getattr(time, "CLOCK_BOOTTIME", None)
    return time.monotonic() if clock is None else time.clock_gettime(clock)


def boot_id(proc: Path = Path("/proc")) -> str:
    """Which start of the machine this is, as the kernel names it; empty where it does not."""
    try:
        return (proc / "sys" / "kernel" / "random" / "boot_id").read_text("utf-8", "replace").strip()
    except OSError:
        return ""
