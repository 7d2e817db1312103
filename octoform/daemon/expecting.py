"""What ought to report: what the tools promise, and signals that measured something before. (Light.)

A reading tool that is offered promises to report: until it was asked, and when it was not asked for long, nothing is
known of what it reads.

Of its signals only what had a number or a truth value counts as having reported: a member that always was null
promises nothing, and texts come and go with what they tell of. What an apply took away is missed by nobody: a tool or a
device that is not offered any more, and a member that the tool's answers have not had since.
"""

from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from typing import Any

from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.coverage import Silence
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


def unread(promised: Iterable[Signal], readings: Iterable[Reading], since: float) -> list[Silence]:
    """What is promised and was not read since ``since`` (uptime in seconds), whatever a reading of it said.

    A promise has no path: it is all that its source reports; without a source, any of its channel.
    """
    last: dict[tuple[Channel, str], float] = {}
    for reading in readings:
        for source in (reading.signal.source, ""):
            key = reading.signal.channel, source
            last[key] = max(reading.uptime, last.get(key, reading.uptime))
    found = []
    for each in promised:
        at = last.get((each.channel, each.source))
        if at is None or at < since:
            why = "it has not been read yet" if at is None else "it was not read for a while"
            found.append((each.source or str(each.channel), each.path, why))
    return found


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
