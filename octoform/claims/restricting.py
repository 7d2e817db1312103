"""What claims restrict, written for the endpoint: each with its end, so that it lets go by itself. Light.

The endpoint knows neither claims nor readings. It reads this file, and an entry counts there only until its moment of
CLOCK_BOOTTIME and only in the start of the machine that it names, whether the daemon lives or not.
"""

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from octoform.claims import storing
from octoform.claims.model import Channel, Claim, Restriction, Value
from octoform.claims.readings import Readings
from octoform.claims.settings import Settings
from octoform.diagnostics import Diagnostic
from octoform.state.files import read_regular, refused, write_atomic
from octoform.state.reading import bytes_of

FORMAT = 1
NAMES = ("name", "id", "label", "unit", "joint", "motor", "channel", "index", "number", "address")
"""Members of a unit's part of a result that say which unit it is."""
SIZE_LIMIT = 4 * 1024 * 1024


def document(claims: Iterable[Claim], boot: str, settings: Settings, readings: Readings) -> bytes:
    """The file's bytes for these active claims; the same for the same claims."""
    entries = [_entry(claim, each, settings, readings) for claim in claims for each in claim.restrictions]
    standing = [storing.to_json(claim) for claim in claims if not math.isfinite(claim.expires)]
    whole = {"format": FORMAT, "boot": boot, "restrictions": entries, "standing": standing}
    return json.dumps(whole, separators=(",", ":"), allow_nan=False).encode("ascii")


def publish(path: Path, data: bytes) -> Diagnostic | None:
    """Put it where the endpoint looks, unless it stands there; None when it does."""
    try:
        if bytes_of(path) == data and not path.is_symlink():
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
        found = [storing.of_json(each) for each in json.loads(data or b"{}").get("standing", [])]
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return []
    return [claim for claim in found if claim.irreversible is not None and claim.data.get("confirmed_by")]


def _entry(claim: Claim, each: Restriction, settings: Settings, readings: Readings) -> dict[str, Any]:
    facts = settings.tools.get(each.tool)
    arguments = {name: [value] for name, value in each.arguments.items()}
    for name, values in arguments.items():
        choices = facts.choices.get(name, ()) if facts is not None else ()
        names = _names_of(values[0], settings.devices_of(each.tool), settings, readings) if choices else frozenset()
        values.extend(choice for choice in choices if str(choice) in names and choice not in values)
    return {
        "claim": claim.id,
        "tool": each.tool,
        "arguments": arguments,
        "effect": each.effect,
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
