"""What ought to report: what the tools promise, and signals that measured something before. (Light.)

A reading tool that is offered promises to report: until it was asked, and when it was not asked for long, nothing is
known of what it reads.

Of its signals only what had a number or a truth value counts as having reported: a member that always was null
promises nothing, and texts come and go with what they tell of. What is not wanted any more is missed by nobody: a tool
or a device that is not offered, whether an apply took it away or the policy denies it; pictures while perception is
switched off, or of a camera that is not looked through any more; a member that the tool's answers have not had since.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.observe.samples import tool_of
from octoform.daemon.signals.reporting import Silence
from octoform.endpoint.publish.expected_tools import hidden, promised
from octoform.state.layout import Layout


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What there is to be read: tools by name that clients are shown, when they were made, the camera looked through.

    ``newest`` is the stamp of the last reading by channel and source. Which tools there are is not known without any.
    """

    tools: Mapping[str, Any]
    made: str
    camera: str | None
    newest: Mapping[tuple[Channel, str], str]

    def has(self, reading: Reading) -> bool:
        """Whether somebody still wants to know what this is a reading of."""
        channel, source = reading.signal.channel, reading.signal.source
        if channel is Channel.FRAME:
            return source == self.camera
        if channel is Channel.PROCESS or not self.tools:
            return True
        if channel is Channel.KERNEL:
            return any(source in (tool.get("devices") or ()) for tool in self.tools.values())
        if channel is Channel.LOG:
            return source in self.tools
        return _is_there(reading, self.tools, self.newest[channel, source], self.made)


def current(readings: Iterable[Reading], layout: Layout, wanted: Iterable[Signal] = ()) -> list[Reading]:
    """These without the ones of what nobody wants to know any more; ``wanted`` is what ought to report (`Promised`).

    All of them but pictures where it cannot be read which tools there are.
    """
    listed = list(readings)
    if not listed:
        return []
    unseen = hidden(layout)
    tools = {name: tool for name, tool in promised(layout).items() if name not in unseen}
    newest: dict[tuple[Channel, str], str] = {}
    for reading in listed:
        place = reading.signal.channel, reading.signal.source
        newest[place] = max(newest.get(place, ""), reading.at)
    looked = [each for each in listed if each.signal.channel is Channel.FRAME]
    last = max(looked, key=lambda each: each.uptime, default=None)
    sees = any(each.channel is Channel.FRAME for each in wanted)
    found = _Wanted(tools, _made(layout), last.signal.source if last is not None and sees else None, newest)
    return [each for each in listed if found.has(each)]


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


def _is_there(reading: Reading, tools: Mapping[str, Any], newest: str, made: str) -> bool:
    source = reading.signal.source
    tool = tools.get(tool_of(source))
    if tool is None:
        return False
    device = source.removeprefix(tool_of(source)).strip("()")
    if device and device not in (tool.get("devices") or ()):
        return False
    return not reading.at < made <= newest


def _made(layout: Layout) -> str:
    """When the tools were last made anew, as stamps of readings are written; empty where that is not known."""
    try:
        seconds = layout.output("interface").stat().st_mtime
    except OSError:
        return ""
    return datetime.fromtimestamp(seconds, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
