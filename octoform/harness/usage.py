"""What an agent says its run cost, read from a file that it may have written.

The numbers come from an untrusted program, so each is checked for itself: one that is no sensible number is unknown,
never zero.
"""

import math
from pathlib import Path

from octoform.base.files import parse
from octoform.harness.plainfile import read_plain
from octoform.harness.port import Usage

FILE_NAME = "usage.json"
SIZE_LIMIT = 64 << 10


def read(workdir: Path) -> Usage:
    """``usage.json`` of the attempt: input_tokens, cached_tokens, output_tokens (counts), cost_usd (dollars)."""
    data = read_plain(workdir / FILE_NAME, SIZE_LIMIT)
    try:
        value = parse(data or b"")
    except ValueError:
        return Usage()
    if not isinstance(value, dict):
        return Usage()
    return Usage(
        input_tokens=_count(value.get("input_tokens")),
        cached_tokens=_count(value.get("cached_tokens")),
        output_tokens=_count(value.get("output_tokens")),
        cost_usd=_money(value.get("cost_usd")),
    )


def _count(value: object) -> int | None:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 1 << 53 else None


def _money(value: object) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) and 0 <= value < 1e9 else None
