"""Durations, rates and hours of the day as people write them: a number without its unit is never guessed at.

Manifest, specs, profiles and the command line write the same times, so what each form means is here once.
"""

import re

_COUNT = r"[0-9]{1,6}(?:\.[0-9]{1,3})?"
PATTERN = rf"^(?=[0-9])({_COUNT}h)?({_COUNT}m)?({_COUNT}s)?({_COUNT}ms)?$"
HINT = "write numbers with h, m, s and ms, in this order: `30s`, `1.5m`, `1h30m`"
MAX_SECONDS = 24 * 3600
RATE_PATTERN = rf"^([1-9][0-9]{{0,5}})/({PATTERN[1:-1]})$"
HOURS_PATTERN = r"^([01][0-9]|2[0-3]):([0-5][0-9])-([01][0-9]|2[0-3]):([0-5][0-9])$"


_MILLISECONDS = (3_600_000, 60_000, 1000, 1)


def seconds(text: str) -> float | None:
    """The length in seconds, an int where it is whole; None when the text is no duration."""
    found = re.fullmatch(PATTERN[1:-1], text)
    if found is None:
        return None
    from decimal import Decimal  # a plan with nothing to do reads no duration

    counts = (Decimal(part.rstrip("hms")) if part else Decimal(0) for part in found.groups())
    length = sum(count * unit for count, unit in zip(counts, _MILLISECONDS, strict=True)) / Decimal(1000)
    return int(length) if length == int(length) else float(length)


def rate(text: str) -> tuple[int, float] | None:
    """How many times in how many seconds (``10/1m`` is 10 in 60); None when the text is no rate of at most a day."""
    found = re.fullmatch(RATE_PATTERN[1:-1], text)
    length = seconds(found.group(2)) if found is not None else None
    if found is None or length is None or not 1 <= length <= MAX_SECONDS:
        return None
    return int(found.group(1)), length


def hours(text: str) -> tuple[str, str] | None:
    """Begin and end of a part of the day (``22:00-07:00``, over midnight); None when the text is none or is empty."""
    found = re.fullmatch(HOURS_PATTERN[1:-1], text)
    begin, _, end = text.partition("-")
    return (begin, end) if found is not None and begin != end else None
