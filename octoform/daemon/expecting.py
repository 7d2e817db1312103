"""What ought to report: signals that measured something before, of tools that are still offered. (Light.)

Only what had a number or a truth value counts as having reported: a member that always was null promises nothing, and
texts come and go with what they tell of. What an apply took away is missed by nobody: a tool or a device that is not
offered any more, and a member that the tool's answers have not had since.
"""

from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from typing import Any

from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.sensing.sampling import tool_of
from octoform.endpoint.promise import promised
from octoform.state.layout import Layout


def current(readings: Iterable[Reading], layout: Layout) -> list[Reading]:
    """These without the ones of sensors that are not there any more since the tools were made anew.

    All of them where it cannot be read which tools there are.
    """
    listed = list(readings)
    if not any(reading.signal.channel is Channel.SENSOR for reading in listed):
        return listed
    tools, made = promised(layout), _made(layout)
    if not tools:
        return listed
    newest: dict[str, str] = {}
    for reading in listed:
        source = reading.signal.source
        newest[source] = max(newest.get(source, ""), reading.at)
    return [
        each for each in listed if each.signal.channel is not Channel.SENSOR or _is_there(each, tools, newest, made)
    ]


def measured(readings: Iterable[Reading], of: Callable[[Signal], Iterable[Reading]]) -> frozenset[Signal]:
    """The signals of sensors among these that have a number or a truth value, or had one as far as ``of`` tells."""
    return frozenset(
        reading.signal
        for reading in readings
        if reading.signal.channel is Channel.SENSOR
        and (_measures(reading) or (reading.value is None and any(map(_measures, of(reading.signal)))))
    )


def _measures(reading: Reading) -> bool:
    return isinstance(reading.value, bool | int | float)


def _is_there(reading: Reading, tools: Mapping[str, Any], newest: Mapping[str, str], made: str) -> bool:
    source = reading.signal.source
    tool = tools.get(tool_of(source))
    if tool is None:
        return False
    device = source.removeprefix(tool_of(source)).strip("()")
    if device and device not in (tool.get("devices") or ()):
        return False
    return not reading.at < made <= newest[source]


def _made(layout: Layout) -> str:
    """When the tools were last made anew, as stamps of readings are written; empty where that is not known."""
    try:
        seconds = layout.output("interface").stat().st_mtime
    except OSError:
        return ""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
