"""All findings of one look, causes before what they cause.

The order matters: repairs are made one after the other, and a process that died because its disk is full, its file
damaged or its packages gone is started last. What another finding explains is no finding of its own.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence

from octoform.base.health_status import Status
from octoform.claims.model import Channel, Reading
from octoform.daemon.model import Facts, FaultClass, Finding, Kind, LastSeen, Repair
from octoform.daemon.observe.samples import tool_of
from octoform.daemon.signals import Silence, silent
from octoform.daemon.triage import process
from octoform.daemon.triage.failure_history import ABSENT, AMBIGUOUS, OVERDUE, Failing, Recall
from octoform.endpoint.client.check_verdict import DEFECTS
from octoform.patterns import regex

# Devices that went, came back somewhere else, or may be another one; and hardware that PROBE never saw.
#
# A device that is gone is waited for: its tools stay and say that it is absent. Only hardware that appeared, or that
# went without being one of the endpoint's devices, is a reason to discover again.

_CLASS = regex(r"^class:(?P<name>.+):(?P<count>\d+)$")


def judge_devices(facts: Facts, before: Facts | None) -> Iterator[Finding]:
    """A finding for each device that is not where it was written down to be."""
    for name, now in sorted(facts.devices.items()):
        former = before.devices.get(name) if before is not None else None
        finding = _doubt(name, now) or _gone(name, now) or _moved(name, now, former)
        if finding is not None:
            yield finding


def hardware(facts: Facts, before: Facts | None) -> Iterator[Finding]:
    """Kinds of hardware that appeared, or went and were none of the endpoint's devices.

    What only went must be gone in two looks: a loose plug is out and in again before its device is asked for.
    """
    appeared, gone = changes(facts.appeared, facts.gone)
    absent = any(each.there is False for each in facts.devices.values())
    lasts = before is not None and (before.appeared, before.gone) == (facts.appeared, facts.gone)
    if not appeared and (not gone or absent or not lasts):
        return
    words = [f"{len(appeared)} appeared"] * bool(appeared) + [f"{len(gone)} went"] * bool(gone)
    yield Finding(
        Kind.HARDWARE_CHANGED,
        FaultClass.DEVICE_MOVED,
        "hardware",
        f"hardware is not what PROBE saw: {', '.join(words)}",
        (*(f"+{each}" for each in appeared), *(f"-{each}" for each in gone)),
        Repair.REDISCOVER,
        (Repair.REDISCOVER, Repair.PERSON),
        data={"appeared": list(appeared), "gone": list(gone)},
    )


def changes(appeared: Sequence[str], gone: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """(appeared, gone) with counts of classes as what they say: fewer of a class is nothing that appeared."""
    more, fewer = _counts(appeared), _counts(gone)
    up = [f"class:{name}:+{more[name] - fewer[name]}" for name in sorted(more) if more[name] > fewer[name]]
    down = [f"class:{name}:-{fewer[name] - more[name]}" for name in sorted(fewer) if fewer[name] > more[name]]
    plain = [tuple(sorted(each for each in entries if not _CLASS.match(each))) for entries in (appeared, gone)]
    return (*plain[0], *up), (*plain[1], *down)


def _counts(entries: Sequence[str]) -> Counter[str]:
    found: Counter[str] = Counter()
    for match in filter(None, map(_CLASS.match, entries)):
        found[match["name"]] += int(match["count"])
    return found


def _doubt(name: str, now: LastSeen) -> Finding | None:
    if now.doubt is None:
        return None
    summary = f"which device {name} is cannot be determined for certain, so nothing that moves is called on it"
    kind, fault, target = Kind.DEVICE_DOUBTFUL, FaultClass.DEVICE_MOVED, f"device:{name}"
    return Finding(kind, fault, target, summary, ("in doubt",), Repair.PERSON, detail=now.doubt[:400])


def _gone(name: str, now: LastSeen) -> Finding | None:
    if now.there is not False:
        return None
    summary = f"{name} is not there; its tools work again once it is"
    return Finding(Kind.DEVICE_GONE, FaultClass.DEVICE_MOVED, f"device:{name}", summary, ("gone",), Repair.WAIT)


def _moved(name: str, now: LastSeen, former: LastSeen | None) -> Finding | None:
    written = now.recorded or (former.place if former is not None else None)
    if not now.there or now.place is None or written is None or written == now.place:
        return None
    back = former is not None and former.there is False
    summary = f"{name} {'is back' if back else 'is'} in another place than the one that was written down"
    return Finding(
        Kind.DEVICE_BACK if back else Kind.DEVICE_MOVED,
        FaultClass.DEVICE_MOVED,
        f"device:{name}",
        summary,
        ("moved", now.place),
        Repair.REBIND,
        (Repair.REBIND, Repair.PERSON),
        data={"device": name, "from": written, "to": now.place},
    )


# Tools that fail for a reason that nothing else explains: the one thing that an agent is asked about.
#
# An exception about the code counts at once; what a device, a line or a client's arguments may have
# caused counts when it happens again with no success between.

AGAIN = 2
"""Failures in a row after which one that may be the room's is taken for the tool's."""
BUSY_AGAIN = 5
_BUSY = "BusBusy"
_OF_PERSON = frozenset({"PermissionError"})
_EXPLAINING = frozenset(
    {Kind.DEVICE_GONE, Kind.DEVICE_MOVED, Kind.DEVICE_BACK, Kind.PACKAGE_DAMAGED, Kind.PACKAGE_CONFLICT}
)
_IMPORTS = frozenset({"ModuleNotFoundError", "ImportError"})


def judge_tools(facts: Facts, recall: Recall, others: Iterable[Finding]) -> Iterator[Finding]:
    """A finding for each tool that fails by itself; none while something else that is wrong explains failures."""
    found = list(others)
    held = {str(each.data["tool"]) for each in found if each.kind is Kind.PROCESS_HUNG and "tool" in each.data}
    explained = facts.process is None or any(each.kind in _EXPLAINING for each in found)
    for name, failing in sorted(recall.failing.items()):
        finding = None if name in held else _judged(name, failing, explained)
        if finding is not None:
            yield finding


def _judged(name: str, failing: Failing, explained: bool) -> Finding | None:
    if failing.error in _IMPORTS:
        return None  # reported as a package
    if failing.error == AMBIGUOUS:
        return _finding(Kind.DEVICE_DOUBTFUL, FaultClass.DEVICE_MOVED, name, failing, Repair.PERSON)
    if failing.error == ABSENT:
        return None if explained else _finding(Kind.DEVICE_GONE, FaultClass.DEVICE_MOVED, name, failing, Repair.WAIT)
    if failing.error in DEFECTS:
        return _finding(Kind.TOOL_FAILING, FaultClass.BROKEN_TOOL, name, failing, Repair.WATCH)
    least = {_BUSY: BUSY_AGAIN, OVERDUE: 1}.get(failing.error, AGAIN)
    if explained or failing.times < least:
        return None
    if failing.error in _OF_PERSON:
        return _finding(Kind.TOOL_FAILING, FaultClass.NONE, name, failing, Repair.PERSON)
    return _finding(Kind.TOOL_FAILING, FaultClass.NONE, name, failing, Repair.WATCH)


def _finding(kind: Kind, fault: FaultClass, name: str, failing: Failing, repair: Repair) -> Finding:
    summary = f"{name} fails: {failing.error}: {failing.message}"[:300]
    data = {"tool": name, "error": failing.error, "message": failing.message, "times": failing.times}
    evidence = (failing.error, failing.said)
    return Finding(kind, fault, f"tool:{name}", summary, evidence, repair, data=data)


# What readings say by themselves: a picture that shows nothing, and a unit that should report and does not.
#
# A tool that fails reports nothing either: that is one problem, reported for the tool
# (`octoform.daemon.triage.classify`) as soon as it is certain; until then health knows that nothing is known of what it
# reads.

_TROUBLE = "/trouble"
_FROZEN = "frozen"
TICKS = 100.0
"""Units of a process's start time in a second, whatever the kernel's own clock (USER_HZ)."""


def judge_signals(
    facts: Facts, readings: Iterable[Reading], failing: Collection[str] = (), others: Iterable[Finding] = ()
) -> Iterator[Finding]:
    """Findings from the newest reading of each signal; nothing of a device that is known to be gone.

    ``failing`` are the tools whose last call failed, ``others`` what is wrong already.
    """
    began = facts.process.start / TICKS if facts.process is not None else 0.0
    # What could not be read of a process that is no more is no evidence about the one that serves now.
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
    """Those that no problem of their tool explains: it has one, or fails wherever it is called."""
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


def judge(
    facts: Facts,
    before: Facts | None = None,
    recall: Recall | None = None,
    readings: Iterable[Reading] = (),
    given_up: Collection[str] = (),
) -> tuple[Finding, ...]:
    """The present findings; empty while an apply is under way, for a host without an endpoint, and when all is well.

    ``before`` are the facts of the look before, ``recall`` what `remember` made of all looks with this one,
    ``readings`` the newest of each signal. The same problem gives equal keys at each look. ``given_up`` are keys of
    problems that no one repairs any more: a process that ended is started again beside them. Where a target and class
    are given up as a whole, other words are no other problem.
    """
    known = recall or Recall()
    if facts.busy is not None or not (facts.applied or known.applied):
        return ()
    standing = [*process.disk(facts), *process.logs(facts), *process.damaged(facts), *process.environment(facts, known)]
    plugged = [*judge_devices(facts, before), *hardware(facts, before)]
    barred = list(process.port(facts))
    # An edited file stays as long as its person wants it: the endpoint is started with it, or refuses with a reason.
    awaited = [each for each in standing if _known(each, given_up).key not in given_up]
    serving = [*barred, *process.judged(facts, known, [*awaited, *barred]), *process.tunnel(facts)]
    using = [*process.beyond_limits(facts), *judge_tools(facts, known, [*standing, *plugged, *serving])]
    reported = judge_signals(facts, readings, known.failing, [*serving, *using])
    return _once([_known(each, given_up) for each in (*standing, *plugged, *serving, *using, *reported)])


def _known(finding: Finding, given_up: Collection[str]) -> Finding:
    return finding.broadly if finding.broadly.key in given_up else finding


def _once(found: list[Finding]) -> tuple[Finding, ...]:
    """Each problem once, reported by the first that noticed it."""
    return tuple({finding.key: finding for finding in reversed(found)}.values())[::-1]
