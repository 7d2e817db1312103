"""Durations as people write them, ``200s`` or ``1h30m``: a number without its unit is never guessed at."""

import re

PATTERN = r"^(?=[0-9])([0-9]{1,6}h)?([0-9]{1,6}m)?([0-9]{1,6}s)?$"
LONGEST_SECONDS = 24 * 3600


def seconds(text: str) -> int | None:
    """The length in seconds, or None when the text is no duration."""
    found = re.fullmatch(PATTERN[1:-1], text)
    if found is None:
        return None
    hours, minutes, rest = (int(part[:-1]) if part else 0 for part in found.groups())
    return hours * 3600 + minutes * 60 + rest
