"""What claims restrict, written for the endpoint: each with its end, so that it lets go by itself. Light.

The endpoint knows neither claims nor readings. It reads this file, and an entry counts there only until its moment of
CLOCK_BOOTTIME and only in the start of the machine that it names, whether the daemon lives or not. What a person made
true has no moment. A claim about a unit of a device restricts that unit, whichever tool an agent thought of.
"""

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from octoform.base.files import parse, read
from octoform.claims import codec
from octoform.claims.model import Channel, Claim, Condition, Restriction, Signal, Value
from octoform.claims.readings import Readings
from octoform.claims.settings import Settings, ToolFacts
from octoform.diagnostics import Diagnostic
from octoform.state.files import read_regular, refused, write_atomic

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
    """Put it where the endpoint looks, unless it stands there; None when it does."""
    try:
        if read(path) == data and not path.is_symlink():
            return None
    except OSError:
        pass  # whatever is wrong with it, it is replaced
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
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
    """Keep which permanent restrictions there are; None when it stands there."""
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
    """What an entry has of its claim."""
    return {
        "claim": claim.id,
        "target": claim.target,
        "statement": claim.statement,
        "expires": claim.expires if math.isfinite(claim.expires) else None,
        "expires_at": claim.expires_at,
    }


def _names_of(value: Value, devices: frozenset[str], settings: Settings, readings: Readings) -> frozenset[str]:
    """By what else a caller names the same unit: its number or its name, as they stand beside its readings."""
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
