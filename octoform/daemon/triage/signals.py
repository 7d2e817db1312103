"""What readings say by themselves: a picture that shows nothing, and a unit that should report and does not.

A tool that fails reports nothing either: that is one trouble, told of the tool (`octoform.daemon.triage.tools`) as soon
as it is certain; until then health knows that nothing is known of what it reads.
"""

from collections.abc import Collection, Iterable, Iterator

from octoform.claims.model import Channel, Reading
from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair, Status
from octoform.daemon.observe.samples import tool_of
from octoform.daemon.signals.reporting import Silence, silent

_TROUBLE = "/trouble"
_FROZEN = "frozen"
TICKS = 100.0
"""Units of a process's start time in a second, whatever the kernel's own clock (USER_HZ)."""


def judged(
    facts: Facts, readings: Iterable[Reading], failing: Collection[str] = (), others: Iterable[Finding] = ()
) -> Iterator[Finding]:
    """Findings from the newest reading of each signal; nothing of a device that is known to be gone.

    ``failing`` are the tools whose last call failed, ``others`` what is wrong already.
    """
    began = facts.process.start / TICKS if facts.process is not None else 0.0
    # What could not be read of a process that is no more says nothing of the one that serves now.
    known = [each for each in readings if each.value is not None or each.uptime >= began]
    gone = {name for name, each in facts.devices.items() if each.there is False}
    yield from _pictures(known, gone)
    targets = {each.target for each in others}
    for source, path, why in _by_themselves(silent(known), known, failing, targets):
        if facts.process is not None and gone.isdisjoint((source, source.partition("(")[2].removesuffix(")"))):
            unit = f"{source}{path}"
            summary = f"{unit} does not report: {why}"[:300]
            yield Finding(
                Kind.UNCOVERED,
                FaultClass.NONE,
                f"unit:{unit}",
                summary,
                ("silent",),
                Repair.WAIT,
                status=Status.UNKNOWN,
                data={"source": source, "path": path},
            )


def _by_themselves(
    found: list[Silence], readings: Iterable[Reading], failing: Collection[str], targets: Collection[str]
) -> Iterator[Silence]:
    """Those that no trouble of their tool explains: it has one, or fails wherever it is called."""
    whole = {source for source, path, _ in found if not path}
    sensors = {each.signal.source for each in readings if each.signal.channel is Channel.SENSOR}
    works = {tool_of(source) for source in sensors - whole}
    for source, path, why in found:
        tool = tool_of(source)
        if path or not (f"tool:{tool}" in targets or (tool in failing and tool not in works)):
            yield source, path, why


def _pictures(readings: Iterable[Reading], gone: set[str]) -> Iterator[Finding]:
    for reading in readings:
        signal = reading.signal
        odd = signal.channel is Channel.FRAME and signal.path == _TROUBLE and isinstance(reading.value, str)
        if odd and reading.value and signal.source not in gone:
            # A dark room is no fault of the deployment and no reason to pay an agent; a camera that stands still is.
            repair = Repair.WATCH if reading.value == _FROZEN else Repair.WAIT
            summary = f"the pictures of {signal.source} are {reading.value}"
            evidence = (str(reading.value),)
            yield Finding(Kind.PICTURE_ODD, FaultClass.NONE, f"device:{signal.source}", summary, evidence, repair)
