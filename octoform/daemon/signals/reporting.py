"""What ought to report and does not: health needs coverage, whoever switched a unit off and why. (Light.)

A field of a result may be null for good reasons, so a null alone says little; a reading that could not be made says
why, and a unit that is left out says so in its member ``skipped``. Where a result says in its member ``unknown`` why it
does not know a value, the tool has answered: a counted position is unknown after each start until its device was taken
to its origin, and that is how such a device is, not one that is silent.
"""

from collections.abc import Iterable, Iterator, Mapping

from octoform.claims.model import Channel, Reading, Signal

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
    """Every unit that cannot report, told once, in order.

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
    """The signals of sensors whose last reading has a value and whose unit is not left out."""
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
    """The signals of sensors that have no value now, and whose result says why it is not known."""
    latest = newest(readings)
    told = {
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
            for source, path, at in told
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
