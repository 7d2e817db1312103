"""Expected and present signals, for health and for the input of agents."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from octoform.base import clock
from octoform.claims.model import Channel, Reading, Signal
from octoform.daemon.observe.samples import tool_of
from octoform.endpoint.expected_tools import hidden, promised
from octoform.records import dataclass
from octoform.state.layout import Layout

# What ought to report and does not: health needs coverage, no matter who switched a unit off and why. (Light.)
#
# A field of a result may be null for good reasons, so a null alone proves little; a reading that could not be made
# gives the reason, and a skipped unit has the member ``skipped``. Where a result gives in its member ``unknown`` why it
# does not know a value, the tool has answered: a counted position is unknown after each start until its device was
# taken to its origin, and that is how such a device is, not one that is silent.

SKIPPED = "/skipped"
UNKNOWN = "/unknown"
NO_VALUE = "it reported before and has no value now"
Silence = tuple[str, str, str]
"""Source, path of the unit in it (empty for all of it), and why it does not report."""


def newest(readings: Iterable[Reading]) -> dict[Signal, Reading]:
    """The last reading of each signal, by uptime."""
    found: dict[Signal, Reading] = {}
    for reading in readings:
        if reading.signal not in found or found[reading.signal].uptime <= reading.uptime:
            found[reading.signal] = reading
    return found


def silent(
    readings: Iterable[Reading], expected: Iterable[Signal] = (), unread: Iterable[Silence] = ()
) -> list[Silence]:
    """Every unit without data, once, in order.

    ``expected`` are signals that reported before, ``unread`` what should report as a whole and was not asked.
    """
    latest = newest(readings)
    found = {(source, path): why for source, path, why in unread}
    found |= {(source, path): why for source, path, why in _skipped(latest) if (source, "") not in found}
    for source, path, why in [*_failed(latest), *_missing(latest, expected)]:
        if not any(source == other and f"{path}/".startswith(f"{above}/") for other, above in found):
            found[source, path] = why
    return sorted((source, path, why) for (source, path), why in found.items())


def reporting(readings: Iterable[Reading]) -> frozenset[Signal]:
    """The signals of sensors whose last reading has a value and whose unit is not omitted."""
    latest = newest(readings)
    left_out = {(source, path) for source, path, _ in _skipped(latest)}
    left_out |= {(source, path) for source, path, _ in _failed(latest) if not path}
    return frozenset(
        signal
        for signal, reading in latest.items()
        if signal.channel is Channel.SENSOR
        and reading.value is not None
        and not signal.path.endswith(SKIPPED)
        and not any(signal.source == source and f"{signal.path}/".startswith(f"{path}/") for source, path in left_out)
    )


def answered(readings: Iterable[Reading]) -> frozenset[Signal]:
    """The signals of sensors that have no value now, and whose result states why it is not known."""
    latest = newest(readings)
    names = {
        (signal.source, signal.path.removesuffix(UNKNOWN), reading.uptime)
        for signal, reading in latest.items()
        if signal.channel is Channel.SENSOR and signal.path.endswith(UNKNOWN) and isinstance(reading.value, str)
    }
    return frozenset(
        signal
        for signal, reading in latest.items()
        if reading.value is None
        and not reading.why
        and any(
            signal.source == source and signal.path.rpartition("/")[0] == path and reading.uptime <= at
            for source, path, at in names
        )
    )


def _skipped(latest: Mapping[Signal, Reading]) -> Iterator[Silence]:
    for signal, reading in latest.items():
        if signal.channel is Channel.SENSOR and signal.path.endswith(SKIPPED) and reading.value:
            yield signal.source, signal.path.removesuffix(SKIPPED), str(reading.value)


def _failed(latest: Mapping[Signal, Reading]) -> Iterator[Silence]:
    worked = _worked(latest)
    for signal, reading in latest.items():
        if signal.channel not in (Channel.SENSOR, Channel.FRAME) or reading.value is not None or not reading.why:
            continue
        if signal.path or reading.uptime > worked.get(signal.source, -1.0):
            yield signal.source, signal.path.removesuffix(SKIPPED), reading.why


def _worked(latest: Mapping[Signal, Reading]) -> dict[str, float]:
    """When a call of each tool last gave something: a failure of the whole tool before that is history."""
    found: dict[str, float] = {}
    for signal, reading in latest.items():
        gave = signal.channel is Channel.SENSOR and signal.path and (reading.value is not None or reading.why)
        if gave or (signal.channel is Channel.LOG and signal.path == "/ok" and reading.value is True):
            found[signal.source] = max(reading.uptime, found.get(signal.source, -1.0))
    return found


def _missing(latest: Mapping[Signal, Reading], expected: Iterable[Signal]) -> Iterator[Silence]:
    known = answered(latest.values())
    for signal in expected:
        if signal in known:
            continue
        reading = latest.get(signal)
        if reading is None:
            yield signal.source, signal.path, "it reported before and was not read since"
        elif reading.value is None and not reading.why and not signal.path.endswith(SKIPPED):
            yield signal.source, signal.path, NO_VALUE


# What ought to report: what the tools promise, and signals that measured something before. (Light.)
#
# A reading tool that is offered promises to report: until it was asked, and when it was not asked for long, nothing is
# known of what it reads.
#
# Of its signals only what had a number or a truth value counts as having reported: a member that always was null
# promises nothing, and texts come and go with what they describe. A signal that is not wanted any more is not missed: a
# tool or a device that is not offered, whether an apply took it away or the policy denies it; pictures while perception
# is switched off, or of a camera that is not looked through any more; a member that the tool's answers have not had
# since.


@dataclass(frozen=True, slots=True)
class _Wanted:
    """The signals to be read: tools by name that clients are shown, when they were made, the camera looked through.

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
    """These without the ones of what no one wants to know any more; ``wanted`` is what ought to report (`Promised`).

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
    """The signals of sensors among these that have a number or a truth value, or had one according to ``of``."""
    return frozenset(
        reading.signal
        for reading in readings
        if reading.signal.channel is Channel.SENSOR
        and (_measures(reading) or (reading.value is None and any(map(_measures, of(reading.signal)))))
    )


def unread(promised: Iterable[Signal], readings: Iterable[Reading], since: float) -> list[Silence]:
    """The promised signals that were not read since ``since`` (uptime in seconds), whatever a former reading was.

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
    """When the tools were last made again, as stamps of readings are written; empty where that is not known."""
    try:
        seconds = layout.output("interface").stat().st_mtime
    except OSError:
        return ""
    return clock.stamp(seconds, 3)
