"""The life of claims in the book: carried on, ended, superseded, remembered. Pure but for the book itself. Light.

Tightening is remembered and loosening is not undone: of all conditions that agents' claims on a signal have had, the
loosest that ended is the tightest that agents get from then on.
"""

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from octoform.base import clock
from octoform.base.files import parse, private_folder, read
from octoform.claims import codec
from octoform.claims.admission import Level
from octoform.claims.codec import EVIDENCE, Book
from octoform.claims.model import Channel, Claim, Condition, Reading, Restriction, Signal, State, Value, holds, tighter
from octoform.claims.readings import Readings, to_json
from octoform.claims.settings import Settings, ToolFacts
from octoform.diagnostics import Diagnostic
from octoform.records import dataclass, replace
from octoform.state.files import read_regular, refused, write_atomic

MAX_ENDED = 200
MAX_CITED = 8
MAX_LEVELS = 256
PENDING_SECONDS = 24 * 3600.0
"""How long a claim waits for a person; a declaration waits permanently."""
ENDED = (State.RETIRED, State.REFUSED)


@dataclass(frozen=True, slots=True)
class Moment:
    """Now: seconds of uptime with the stamp beside, and the seconds that a reading carries a claim at most."""

    uptime: float
    stamp: str
    most: float


def in_force(book: Book, moment: Moment) -> tuple[Claim, ...]:
    """The claims that are believed now, oldest first."""
    return tuple(
        claim for claim in book.claims.values() if claim.state is State.ACTIVE and moment.uptime < claim.expires
    )


def waiting(book: Book) -> tuple[Claim, ...]:
    """The claims that wait for a person."""
    return tuple(claim for claim in book.claims.values() if claim.state is State.PENDING)


def weigh(book: Book, reading: Reading, moment: Moment) -> None:
    """Apply one reading to the claims on its signal: end them, carry them on, or neither."""
    for claim in list(book.claims.values()):
        if claim.signal != reading.signal or claim.irreversible is not None or claim.state in ENDED:
            continue
        evidence = codec.evidence_of(claim)
        if evidence is not None and reading.uptime < evidence.uptime:
            continue
        verdict = holds(claim.condition, reading.value)
        if verdict is False:
            end(book, claim, "contradicted", (reading.id,), reading)
        elif verdict is True and claim.state is State.ACTIVE and moment.uptime < claim.expires:
            book.claims[claim.id] = carried(claim, reading, moment)


def carried(claim: Claim, evidence: Reading, moment: Moment) -> Claim:
    """The claim as this reading carries it on."""
    cites = (*[each for each in claim.cites if each != evidence.id][-MAX_CITED + 1 :], evidence.id)
    expires = min(evidence.uptime, moment.uptime) + codec.seconds_of(claim, moment.most)
    stamp = _later(moment.stamp, expires - moment.uptime)
    data = {**claim.data, EVIDENCE: to_json(evidence)}
    return replace(claim, cites=cites, expires=expires, expires_at=stamp, data=data)


def enter(book: Book, claim: Claim, moment: Moment) -> None:
    """Put a claim into the book as it is from now on."""
    if claim.id not in book.claims:
        book.count += 1
    if claim.state is State.ACTIVE and claim.irreversible is None:
        _supersede(book, claim, moment)
        _spend(book, claim)
    book.claims[claim.id] = claim
    if claim.state is State.RETIRED:
        _remember(book, claim, None)


def expire(book: Book, moment: Moment) -> None:
    """End what is over."""
    now = moment.uptime
    for claim in list(book.claims.values()):
        waits = claim.state is State.PENDING and claim.irreversible is None
        until = claim.made + PENDING_SECONDS if waits else claim.expires
        if claim.state not in ENDED and not now < until:
            end(book, claim, "expired", (), None)
    for signal in [signal for signal, spent in book.spent.items() if spent + moment.most < now]:
        del book.spent[signal]


def trust(book: Book, same_boot: bool, moment: Moment) -> None:
    """End what cannot be justified as it is in a file: evidence of an earlier start of the machine, or none."""
    for claim in list(book.claims.values()):
        if claim.state in ENDED:
            continue
        if claim.irreversible is None and not same_boot:
            end(book, claim, "expired", ("boot",), None)
        elif claim.state is State.PENDING:
            continue
        elif moment.uptime < claim.expires and not codec.is_justified(claim, moment.most, moment.uptime):
            end(book, claim, "expired", ("unjustified",), None)
    if not same_boot:
        book.spent.clear()


def end(book: Book, claim: Claim, why: str, by: tuple[str, ...], clean: Reading | None) -> None:
    """End a claim; one that was in force is remembered, with the reading at which it was clean."""
    book.claims[claim.id] = ended = as_ended(claim, why, by)
    if claim.state is State.ACTIVE:
        _remember(book, ended, clean)


def as_ended(claim: Claim, why: str, by: tuple[str, ...], state: State = State.RETIRED) -> Claim:
    """The claim as it is when it is over."""
    return replace(claim, state=state, ended=why, ended_by=by)


def prune(book: Book) -> None:
    """Forget the oldest of what is over."""
    ended = [name for name, claim in book.claims.items() if claim.state in ENDED]
    for name in ended[:-MAX_ENDED]:
        del book.claims[name]


def _supersede(book: Book, claim: Claim, moment: Moment) -> None:
    for other in in_force(book, moment):
        same = other.signal == claim.signal and other.target == claim.target
        if same and other.id != claim.id and other.irreversible is None:
            end(book, other, "superseded", (claim.id,), None)


def _spend(book: Book, claim: Claim) -> None:
    evidence = codec.evidence_of(claim)
    if claim.restrictions and evidence is not None:
        signal: Signal = claim.signal
        book.spent[signal] = max(book.spent.get(signal, evidence.uptime), evidence.uptime)


def _remember(book: Book, claim: Claim, clean: Reading | None) -> None:
    if claim.irreversible is not None:
        return
    mine = [level for level in book.levels if level.signal == claim.signal]
    if any(tighter(claim.condition, level.condition) for level in mine):
        return
    equal = [level for level in mine if level.condition == claim.condition]
    if equal and clean is None:
        return
    gone = [level for level in mine if level in equal or tighter(level.condition, claim.condition)]
    book.levels[:] = [level for level in book.levels if level not in gone][-MAX_LEVELS + 1 :]
    book.levels.append(Level(claim.signal, claim.condition, claim.id, clean))


def _later(stamp: str, seconds: float) -> str:
    moment = clock.epoch(stamp)
    try:
        return "" if moment is None else clock.stamp(moment + max(0.0, seconds))
    except (ValueError, OverflowError):
        return ""


# What claims restrict, written for the endpoint: each with its end, so that it lets go by itself. Light.
#
# The endpoint knows neither claims nor readings. It reads this file, and an entry counts there only until its moment of
# CLOCK_BOOTTIME and only in the start of the machine that it names, whether the daemon lives or not. What a person made
# true has no moment. A claim about a unit of a device restricts that unit, whichever tool an agent thought of.

FORMAT = 1
NAMES = ("name", "id", "label", "unit", "joint", "motor", "channel", "index", "number", "address")
"""Members of a unit's part of a result that say which unit it is."""
UNTOLD = "c0"
"""In place of ids that cannot be read; no claim has it."""
SIZE_LIMIT = 4 * 1024 * 1024


def document(claims: Sequence[Claim], boot: str, settings: Settings, readings: Readings) -> bytes:
    """The file's bytes for these active claims; the same for the same claims."""
    entries = [entry for claim in claims for entry in _entries(claim, settings, readings)]
    standing = [codec.to_json(claim) for claim in claims if not math.isfinite(claim.expires)]
    whole = {"format": FORMAT, "boot": boot, "restrictions": entries, "standing": standing}
    return json.dumps(whole, separators=(",", ":"), allow_nan=False).encode("ascii")


def publish(path: Path, data: bytes) -> Diagnostic | None:
    """Put it where the endpoint looks, unless it is there; None when it does."""
    try:
        if read(path) == data and not path.is_symlink():
            return None
    except OSError:
        pass  # whatever is wrong with it, it is replaced
    try:
        private_folder(path.parent)
    except OSError as problem:
        return refused(problem, path)
    return write_atomic(path, data, 0o600)


def standing(path: Path) -> list[Claim]:
    """What a person made true, from the endpoint's file: the second place where it stands; empty when there is none."""
    data, _ = read_regular(path, SIZE_LIMIT)
    try:
        found = [codec.of_json(each) for each in parse(data or b"{}").get("standing", [])]
    except (ValueError, KeyError, TypeError, AttributeError):
        return []
    return [claim for claim in found if claim.irreversible is not None and claim.data.get("confirmed_by")]


def forbidden(path: Path) -> frozenset[str]:
    """The ids of the permanent restrictions that there were last; `UNTOLD` alone where the file cannot be read."""
    data, problem = read_regular(path, SIZE_LIMIT)
    if data is None and problem is None:
        return frozenset()
    try:
        return frozenset(str(each) for each in parse(data or b"")["claims"])
    except (ValueError, KeyError, TypeError):
        return frozenset((UNTOLD,))


def forbid(path: Path, ids: frozenset[str]) -> Diagnostic | None:
    """Keep which permanent restrictions there are; None when it is there."""
    if ids == forbidden(path):
        return None
    return write_atomic(path, json.dumps({"format": FORMAT, "claims": sorted(ids)}).encode("ascii"), 0o600)


def unknown(identity: str, moment: tuple[float, str]) -> Claim:
    """A permanent restriction of which nothing is known but that there was one: nothing moves until a person ends it.

    ``moment`` is now, in seconds of CLOCK_BOOTTIME and as a time.
    """
    uptime, stamp = moment
    return Claim(
        id=identity,
        target="deployment:all",
        fault="unknown",
        statement="what a person has forbidden here is lost: its files are gone or cannot be read, so nothing moves",
        signal=Signal(Channel.LOG, "", ""),
        condition=Condition("==", None),
        cites=(),
        by="person",
        made_at=stamp,
        made=uptime,
        expires_at="",
        expires=math.inf,
        irreversible="lost",
        data={"confirmed_by": "octoform"},
    )


def _entries(claim: Claim, settings: Settings, readings: Readings) -> Iterator[dict[str, Any]]:
    if claim.irreversible is not None:
        yield _declared(claim, settings, readings)
    made = [_entry(claim, each, settings, readings) for each in claim.restrictions]
    yield from (entry for index, entry in enumerate(made) if entry not in made[:index])


def _declared(claim: Claim, settings: Settings, readings: Readings) -> dict[str, Any]:
    """A permanent restriction: nothing that it is about moves, whichever tool moves it."""
    kind, _, name = claim.target.partition(":")
    whole = {**_frame(claim), "kind": str(claim.irreversible), "tool": "", "arguments": {}, "effect": "deny"}
    if kind == "device":
        device, _, unit = name.partition("/")
        return {**whole, "device": device, "units": _unit(unit, device, settings, readings)}
    return {**whole, "tool": name if kind == "tool" else ""}


def _entry(claim: Claim, each: Restriction, settings: Settings, readings: Readings) -> dict[str, Any]:
    """A restriction of the unit that the claim or its arguments name; else of calls with these arguments."""
    facts = settings.tools.get(each.tool)
    whole = {**_frame(claim), "tool": each.tool, "arguments": {}, "effect": each.effect}
    device, unit = _place(claim, each, facts)
    if unit:
        return {**whole, "device": device, "units": _unit(unit, device, settings, readings)}
    arguments = {name: [value] for name, value in each.arguments.items()}
    for name, values in arguments.items():
        choices = facts.choices.get(name, ()) if facts is not None else ()
        names = _names_of(values[0], settings.devices_of(each.tool), settings, readings) if choices else frozenset()
        values.extend(choice for choice in choices if str(choice) in names and choice not in values)
    return {**whole, "arguments": arguments}


def _place(claim: Claim, each: Restriction, facts: ToolFacts | None) -> tuple[str, str]:
    """(device, unit) that a restriction is of: as its tool's arguments name it, else as the claim's target does."""
    kind, _, name = claim.target.partition(":")
    device, _, unit = name.partition("/") if kind == "device" else ("", "", "")
    if facts is not None and not device:
        named = each.arguments.get("device")
        device = str(named) if named is not None else facts.devices[0] if len(facts.devices) == 1 else ""
    if facts is not None and facts.names_unit_by in each.arguments:
        unit = str(each.arguments[facts.names_unit_by])
    return device, unit if device else ""


def _unit(unit: str, device: str, settings: Settings, readings: Readings) -> list[str]:
    """Every word for a unit, its own name first; empty for a whole device."""
    if not unit:
        return []
    words = _names_of(unit, frozenset({device}), settings, readings)
    return [unit, *sorted(words - {unit})]


def _frame(claim: Claim) -> dict[str, Any]:
    """The fields of an entry from its claim."""
    return {
        "claim": claim.id,
        "target": claim.target,
        "statement": claim.statement,
        "expires": claim.expires if math.isfinite(claim.expires) else None,
        "expires_at": claim.expires_at,
    }


def _names_of(value: Value, devices: frozenset[str], settings: Settings, readings: Readings) -> frozenset[str]:
    """By what else a caller names the same unit: its number or its name, as they are beside its readings."""
    units: dict[tuple[str, str], set[str]] = {}
    latest = [each for each in readings.newest() if each.signal.channel is Channel.SENSOR]
    sources = {each.signal.source for each in latest}
    ours = {source for source in sources if devices & settings.devices_of(source)}
    for reading in latest:
        signal = reading.signal
        prefix, _, field = signal.path.rpartition("/")
        if prefix and signal.source in ours:
            names = units.setdefault((signal.source, prefix), {prefix.rpartition("/")[2]})
            if field in NAMES and reading.value is not None:
                names.add(str(reading.value))
    found = [names for names in units.values() if str(value) in names]
    return frozenset().union(*found)
