"""The limits of a profile: what one must say, and how it is reported to an agent. Pure.

A range is in the tools that INTERFACE makes, so that a client sees it. All other limits concern calls that came
before; the endpoint keeps them, outside the generated server.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base import durations

FIELDS = (
    *("tool", "parameter", "minimum", "maximum", "unit"),
    *("step", "cumulative", "zero", "rate", "cooldown", "quiet_hours"),
)
RANGE = ("minimum", "maximum")
BOUNDS = (*RANGE, "step", "cumulative")
"""The fields of a limit for the value of a parameter."""
PACES = ("rate", "cooldown", "quiet_hours")
"""The fields of a limit for calls, whatever their arguments."""

Problem = tuple[str, str | None]


def problem(item: Mapping[str, Any]) -> Problem | None:
    """The problem of a limit, and what to do about it; None when it is sound. Unknown fields are another matter."""
    for name in ("parameter", "tool", "unit", "zero"):
        if name in item and not (isinstance(item[name], str) and item[name].strip()):
            return f"{name!r} of a limit is not a string", None
    bounds, paces = [name for name in BOUNDS if name in item], [name for name in PACES if name in item]
    return _scope(item, bounds, paces) or _numbers(item, bounds) or _times(item)


def _scope(item: Mapping[str, Any], bounds: list[str], paces: list[str]) -> Problem | None:
    """Whether it limits anything, and names what."""
    if not bounds and not paces:
        return "the limit bounds nothing", f"give it one of {', '.join((*BOUNDS, *PACES))}"
    if bounds and "parameter" not in item:
        return "the limit does not name its parameter", f"name the parameter {bounds[0]!r} is"
    if not bounds and "parameter" in item:
        return "nothing in the limit speaks of its parameter", f"remove it, or give one of {', '.join(BOUNDS)}"
    if "zero" in item and "cumulative" not in item:
        return "`zero` is of a limit without `cumulative`", "it names the tool after which a sum begins again at zero"
    if not bounds and "tool" not in item:
        return "the limit does not name its tool", f"name the tool {paces[0]!r} is"
    return None


def _numbers(item: Mapping[str, Any], bounds: list[str]) -> Problem | None:
    for name in bounds:
        value = item[name]
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            return f"{name!r} of the limit is no number", None
        if name not in RANGE and value <= 0:
            return f"{name!r} of the limit is not above 0", "it counts in both directions"
    if "minimum" in item and "maximum" in item and item["minimum"] > item["maximum"]:
        return "the minimum is above the maximum", None
    return None


def _times(item: Mapping[str, Any]) -> Problem | None:
    rate, cooldown, quiet = (item.get(name) for name in PACES)
    if "rate" in item and not (isinstance(rate, str) and durations.rate(rate)):
        return "'rate' of the limit is no rate", "write how many calls in which time, at most 24h: 10/1m"
    if "cooldown" in item:
        seconds = durations.seconds(cooldown) if isinstance(cooldown, str) else None
        if seconds is None or not 1 <= seconds <= durations.MAX_SECONDS:
            return "'cooldown' of the limit is no duration from 1s to 24h", durations.HINT
    if "quiet_hours" in item and not (isinstance(quiet, str) and durations.hours(quiet)):
        return "'quiet_hours' of the limit are no hours of a day", "write two different times: 22:00-07:00"
    return None


def describe(item: Mapping[str, Any]) -> Iterator[str]:
    """A limit in words, one text for what an agent has to carry and one for what octoform keeps by itself."""
    unit = f" {item['unit']}" if "unit" in item else ""
    words = {"minimum": "at least", "maximum": "at most"}
    ranges = [f"{word} {item[name]}" for name, word in words.items() if name in item]
    whose = f" of {item['tool']}" if "tool" in item else ""
    if ranges:
        yield f"{item['parameter']}{whose} {' and '.join(ranges)}{unit}"
    others = list(_others(item, unit))
    if others:
        lead = f"{item['parameter']}{whose}" if "parameter" in item else item["tool"]
        yield f"{lead}: {', '.join(others)}; the endpoint itself sees to it"


def _others(item: Mapping[str, Any], unit: str) -> Iterator[str]:
    if "step" in item:
        yield f"from call to call no further than {item['step']}{unit}"
    if "cumulative" in item:
        since = f" since the last {item['zero']}" if "zero" in item else ""
        yield f"all values{since} added up within {item['cumulative']}{unit} in both directions"
    if "rate" in item:
        count, _, time = item["rate"].partition("/")
        yield f"at most {count} call{'' if count == '1' else 's'} in {time}"
    if "cooldown" in item:
        yield f"at least {item['cooldown']} between two calls"
    if "quiet_hours" in item:
        yield f"no calls from {item['quiet_hours'].replace('-', ' to ')}"
