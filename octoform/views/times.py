"""Times as a person at the machine reads them: the clock on the wall, and how long ago."""

from datetime import UTC, datetime

from octoform.views.text import one_line


def clock(stamp: str, now: datetime | None = None) -> str:
    """The local time of an RFC 3339 stamp: ``03:12:40``, on another day with its date; the text where it is none."""
    at = _parsed(stamp)
    if at is None:
        return one_line(stamp, 30)
    local = at.astimezone()
    today = (now or datetime.now(UTC)).astimezone().date()
    return local.strftime("%H:%M:%S" if local.date() == today else "%Y-%m-%d %H:%M:%S")


def ago(stamp: str, now: datetime | None = None) -> str:
    """How long that is ago, ``2 h 5 min``; empty where the stamp is none or lies ahead."""
    at = _parsed(stamp)
    seconds = ((now or datetime.now(UTC)) - at).total_seconds() if at is not None else -1.0
    return length(seconds) if seconds >= 0 else ""


def length(seconds: float) -> str:
    """A length with its two largest units: ``0.4 s``, ``12 s``, ``2 min 5 s``, ``2 h 5 min``, ``3 d 4 h``."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    whole = int(seconds)
    units = (("d", whole // 86400), ("h", whole // 3600 % 24), ("min", whole // 60 % 60), ("s", whole % 60))
    first = next(index for index, (_, count) in enumerate(units) if count)
    return " ".join(f"{count} {unit}" for unit, count in units[first : first + 2] if count)


def _parsed(stamp: str) -> datetime | None:
    try:
        at = datetime.fromisoformat(stamp)
    except ValueError:
        return None
    return at if at.tzinfo is not None else at.replace(tzinfo=UTC)
