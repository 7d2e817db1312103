"""Claims as JSON and the file that keeps them; a damaged, newer or foreign one is reported and moved away. Light.

A restriction without evidence is no restriction: only the ledger has which reading a claim stands
on, so none is in force, and what the profile and the manifest limit stands as it did. What a person made true stands
in the endpoint's file too and is taken from there.
"""

import contextlib
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from octoform.base.files import move, parse, record
from octoform.claims import readings as reading_json
from octoform.claims.admission import Level
from octoform.claims.model import Channel, Claim, Condition, Reading, Restriction, Signal, State, holds
from octoform.conditions import OPERATORS
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass, field
from octoform.state.files import display, read_regular, write_atomic

FORMAT = 1
SIZE_LIMIT = 8 * 1024 * 1024
EVIDENCE, SECONDS = "evidence", "seconds"
"""The content of a claim's ``data``: the reading that carries it now, and for how long each may."""


@dataclass(slots=True)
class Book:
    """Everything that is kept. ``claims`` by id, oldest first; ``spent`` as in `judging.View`."""

    claims: dict[str, Claim] = field(default_factory=dict)
    levels: list[Level] = field(default_factory=list)
    spent: dict[Signal, float] = field(default_factory=dict)
    count: int = 0


@dataclass(frozen=True, slots=True)
class Read:
    """A file as it was read. ``boot`` is the start of the machine that it is from; ``said`` lists what is wrong."""

    book: Book
    boot: str = ""
    said: tuple[Diagnostic, ...] = ()


def read(path: Path) -> Read:
    """The book at ``path``, empty when there is none; one that cannot be used is moved away."""
    data, problem = read_regular(path, SIZE_LIMIT)
    if problem is None and data is None:
        return Read(Book())
    if problem is None and data is not None:
        try:
            document = record(parse(data), FORMAT)
            return Read(_book(document), str(document["boot"]))
        except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as wrong:
            problem = _damaged(path, f"{type(wrong).__name__}: {wrong}")
    assert problem is not None
    aside = path.with_name(f"{path.name}.aside")
    with contextlib.suppress(OSError):  # the next write replaces it or reports why not
        move(path, aside)
    return Read(Book(), said=(problem,))


def write(path: Path, book: Book, boot: str) -> Diagnostic | None:
    """Keep it; None when that is done."""
    document = {
        "format": FORMAT,
        "boot": boot,
        "count": book.count,
        "claims": [to_json(claim) for claim in book.claims.values()],
        "levels": [_level_json(level) for level in book.levels],
        "spent": [[*_signal_json(signal).values(), uptime] for signal, uptime in book.spent.items()],
    }
    return write_atomic(path, json.dumps(document, allow_nan=False, separators=(",", ":")).encode("ascii"), 0o600)


def to_json(claim: Claim) -> dict[str, Any]:
    """A claim as JSON; ``expires`` is null for what only a person ends."""
    return {
        "id": claim.id,
        "target": claim.target,
        "fault": claim.fault,
        "statement": claim.statement,
        "signal": _signal_json(claim.signal),
        "condition": {"op": claim.condition.op, "value": claim.condition.value},
        "cites": list(claim.cites),
        "by": claim.by,
        "made_at": claim.made_at,
        "made": claim.made,
        "expires_at": claim.expires_at,
        "expires": claim.expires if math.isfinite(claim.expires) else None,
        "state": claim.state.value,
        "restrictions": [restriction_json(each) for each in claim.restrictions],
        "irreversible": claim.irreversible,
        "ended": claim.ended,
        "ended_by": list(claim.ended_by),
        "data": dict(claim.data),
    }


def restriction_json(each: Restriction) -> dict[str, Any]:
    """A restriction as JSON."""
    return {"tool": each.tool, "arguments": dict(each.arguments), "effect": each.effect}


def of_json(document: Mapping[str, Any]) -> Claim:
    """The claim of `to_json`; KeyError, ValueError or TypeError when it is none."""
    condition = Condition(str(document["condition"]["op"]), document["condition"]["value"])
    irreversible = document["irreversible"]
    if irreversible is None and condition.op not in OPERATORS:
        raise ValueError(f"{condition.op!r} compares nothing")
    expires = document["expires"]
    return Claim(
        id=str(document["id"]),
        target=str(document["target"]),
        fault=str(document["fault"]),
        statement=str(document["statement"]),
        signal=_signal(document["signal"]),
        condition=condition,
        cites=tuple(str(each) for each in document["cites"]),
        by=str(document["by"]),
        made_at=str(document["made_at"]),
        made=float(document["made"]),
        expires_at=str(document["expires_at"]),
        expires=math.inf if expires is None else float(expires),
        state=State(document["state"]),
        restrictions=tuple(_restriction(each) for each in document["restrictions"]),
        irreversible=None if irreversible is None else str(irreversible),
        ended=None if document["ended"] is None else str(document["ended"]),
        ended_by=tuple(str(each) for each in document["ended_by"]),
        data=dict(document["data"]),
    )


def evidence_of(claim: Claim) -> Reading | None:
    """The reading that carries a claim now, as the claim itself keeps it."""
    found = claim.data.get(EVIDENCE)
    return reading_json.of_json(found) if isinstance(found, Mapping) else None


def seconds_of(claim: Claim, most: float) -> float:
    """How long one reading carries it."""
    seconds = claim.data.get(SECONDS)
    return min(float(seconds), most) if isinstance(seconds, int | float) and seconds > 0 else most


def is_justified(claim: Claim, most: float, now: float) -> bool:
    """Whether an active claim of the book may be believed: by a person for good, or by evidence that is fresh."""
    if claim.irreversible is not None:
        return bool(claim.data.get("confirmed_by"))
    evidence = evidence_of(claim)
    if evidence is None or evidence.signal != claim.signal or evidence.id not in claim.cites:
        return False
    latest = min(evidence.uptime, now) + seconds_of(claim, most)
    return holds(claim.condition, evidence.value) is True and now < claim.expires <= latest + 0.01


def _book(document: Mapping[str, Any]) -> Book:
    claims = [of_json(each) for each in document["claims"]]
    levels = [_level(each) for each in document["levels"]]
    spent = {_signal(dict(zip(_NAMES, each[:3], strict=True))): float(each[3]) for each in document["spent"]}
    return Book({claim.id: claim for claim in claims}, levels, spent, int(document["count"]))


_NAMES: Sequence[str] = ("channel", "source", "path")


def _signal_json(signal: Signal) -> dict[str, str]:
    return {"channel": signal.channel.value, "source": signal.source, "path": signal.path}


def _signal(document: Mapping[str, Any]) -> Signal:
    return Signal(Channel(document["channel"]), str(document["source"]), str(document["path"]))


def _restriction(document: Mapping[str, Any]) -> Restriction:
    if document["effect"] not in ("deny", "confirm"):
        raise ValueError(f"{document['effect']!r} is no effect of a restriction")
    return Restriction(str(document["tool"]), dict(document["arguments"]), str(document["effect"]))


def _level_json(level: Level) -> dict[str, Any]:
    return {
        "signal": _signal_json(level.signal),
        "condition": {"op": level.condition.op, "value": level.condition.value},
        "claim": level.claim,
        "clean": None if level.clean is None else reading_json.to_json(level.clean),
    }


def _level(document: Mapping[str, Any]) -> Level:
    condition = Condition(str(document["condition"]["op"]), document["condition"]["value"])
    clean = reading_json.of_json(document["clean"])
    return Level(_signal(document["signal"]), condition, str(document["claim"]), clean)


def _damaged(path: Path, why: str) -> Diagnostic:
    return error(
        "CLAIM-LEDGER-DAMAGED",
        "the ledger of claims cannot be read, so no claim of it is believed and nothing is restricted by one",
        path=display(path),
        detail=why[:500],
        hint="limits of the profiles and of the manifest hold as before; the file is kept beside its place",
    )
