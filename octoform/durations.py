"""Durations, rates and hours of the day as people write them: a number without its unit is never guessed at.

Manifest and profiles speak of the same times, so what each form means stands here once.
"""

import re

PATTERN = r"^(?=[0-9])([0-9]{1,6}h)?([0-9]{1,6}m)?([0-9]{1,6}s)?$"
LONGEST_SECONDS = 24 * 3600
RATE_PATTERN = rf"^([1-9][0-9]{{0,5}})/({PATTERN[1:-1]})$"
HOURS_PATTERN = r"^([01][0-9]|2[0-3]):([0-5][0-9])-([01][0-9]|2[0-3]):([0-5][0-9])$"


def seconds(text: str) -> int | None:
    """The length in seconds, or None when the text is no duration."""
    found = re.fullmatch(PATTERN[1:-1], text)
    if found is None:
        return None
    hours, minutes, rest = (int(part[:-1]) if part else 0 for part in found.groups())
    return hours * 3600 + minutes * 60 + rest


def rate(text: str) -> tuple[int, int] | None:
    """How many times in how many seconds (``10/1m`` is 10 in 60); None when the text is no rate of at most a day."""
    found = re.fullmatch(RATE_PATTERN[1:-1], text)
    length = seconds(found.group(2)) if found is not None else None
    if found is None or length is None or not 1 <= length <= LONGEST_SECONDS:
        return None
    return int(found.group(1)), length


def hours(text: str) -> tuple[str, str] | None:
    """Begin and end of a part of the day (``22:00-07:00``, over midnight); None when the text is none or is empty."""
    found = re.fullmatch(HOURS_PATTERN[1:-1], text)
    begin, _, end = text.partition("-")
    return (begin, end) if found is not None and begin != end else None
