"""A claim as somebody would like it: checked for its shape here, for its truth by the ledger. Light.

Agents write proposals as JSON. What does not have the form is told as CLAIM-MALFORMED and nothing of it is used.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from octoform.claims.model import Channel, Condition, Restriction, Signal, Value
from octoform.conditions import OPERATORS
from octoform.diagnostics import Diagnostic, error
from octoform.escaping import escaped

DECLARATIONS = ("terminal_lock", "disable_unit", "fire_risk")
EFFECTS = ("deny", "confirm")
MOST_CITES, MOST_RESTRICTIONS, MOST_ARGUMENTS = 32, 32, 16
STATEMENT_CHARS, NAME_CHARS = 600, 300


@dataclass(frozen=True, slots=True)
class Proposal:
    """``seconds`` None: as long as a claim may hold. An irreversible one needs neither signal nor condition."""

    target: str
    fault: str
    statement: str
    signal: Signal | None = None
    condition: Condition | None = None
    cites: tuple[str, ...] = ()
    seconds: float | None = None
    restrictions: tuple[Restriction, ...] = ()
    irreversible: str | None = None


class _MalformedError(ValueError):
    """What is wrong, for a person."""


def of_claim(document: object) -> Proposal | Diagnostic:
    """The proposal in one of WATCH's or HEAL's ``claims``; CLAIM-MALFORMED when it has another form."""
    try:
        whole = _object(document, "a claim")
        return Proposal(
            target=_text(whole, "target"),
            fault=_text(whole, "fault"),
            statement=_text(whole, "statement", STATEMENT_CHARS),
            signal=_signal(whole.get("signal")),
            condition=_condition(whole.get("condition")),
            cites=_cites(whole),
            seconds=_seconds(whole.get("seconds")),
            restrictions=tuple(_restriction(item) for item in _array(whole, "restrictions", MOST_RESTRICTIONS)),
        )
    except _MalformedError as problem:
        return malformed(str(problem))


def of_declaration(document: object) -> Proposal | Diagnostic:
    """The proposal in one of WATCH's ``declarations``; CLAIM-MALFORMED when it has another form."""
    try:
        whole = _object(document, "a declaration")
        kind = _text(whole, "kind")
        if kind not in DECLARATIONS:
            raise _MalformedError(f"a declaration is one of {', '.join(DECLARATIONS)}, not {escaped(kind)[:60]!r}")
        return Proposal(
            target=_text(whole, "target"),
            fault="none",
            statement=_text(whole, "statement", STATEMENT_CHARS),
            cites=_cites(whole),
            irreversible=kind,
        )
    except _MalformedError as problem:
        return malformed(str(problem))


def malformed(text: str) -> Diagnostic:
    """CLAIM-MALFORMED with these words."""
    return error("CLAIM-MALFORMED", f"this is no claim: {text}", hint="octoform explain CLAIM-MALFORMED shows the form")


def problem_of(proposal: Proposal) -> Diagnostic | None:
    """CLAIM-MALFORMED for a proposal that was made in code and breaks the form, else None."""
    condition = proposal.condition
    try:
        for name, value, most in (
            ("target", proposal.target, NAME_CHARS),
            ("statement", proposal.statement, STATEMENT_CHARS),
        ):
            if not value or len(value) > most:
                raise _MalformedError(f"{name} has 1 to {most} characters")
        if proposal.irreversible is None and (proposal.signal is None or condition is None):
            raise _MalformedError("it has no signal or no condition")
        if proposal.irreversible is not None and proposal.irreversible not in DECLARATIONS:
            raise _MalformedError(f"a declaration is one of {', '.join(DECLARATIONS)}")
        if condition is not None:
            _condition({"op": condition.op, "value": condition.value})
        _seconds(proposal.seconds)
        if len(proposal.cites) > MOST_CITES or len(proposal.restrictions) > MOST_RESTRICTIONS:
            raise _MalformedError(f"at most {MOST_CITES} cites and {MOST_RESTRICTIONS} restrictions")
        for each in proposal.restrictions:
            _restriction({"tool": each.tool, "arguments": dict(each.arguments), "effect": each.effect})
    except _MalformedError as problem:
        return malformed(str(problem))
    return None


def _signal(document: object) -> Signal:
    whole = _object(document, "signal")
    channel = _text(whole, "channel")
    if channel not in set(Channel):
        raise _MalformedError(f"a channel is one of {', '.join(Channel)}")
    return Signal(Channel(channel), _text(whole, "source"), _text(whole, "path"))


def _condition(document: object) -> Condition:
    whole = _object(document, "condition")
    op, value = whole.get("op"), whole.get("value")
    if op not in OPERATORS:
        raise _MalformedError(f"a condition's op is one of {' '.join(OPERATORS)}")
    if not _is_value(value) or value is None:
        raise _MalformedError("a condition compares with a number, a truth value or a text")
    return Condition(str(op), value)


def _restriction(document: object) -> Restriction:
    whole = _object(document, "a restriction")
    arguments = _object(whole.get("arguments") or {}, "arguments")
    effect = whole.get("effect", "deny")
    if effect not in EFFECTS:
        raise _MalformedError(f"a restriction's effect is one of {', '.join(EFFECTS)}")
    if len(arguments) > MOST_ARGUMENTS or not all(_is_value(value) for value in arguments.values()):
        raise _MalformedError(f"a restriction has at most {MOST_ARGUMENTS} arguments, each a plain value")
    return Restriction(_text(whole, "tool"), dict(arguments), str(effect))


def _cites(whole: Mapping[str, Any]) -> tuple[str, ...]:
    cites = _array(whole, "cites", MOST_CITES)
    if not all(isinstance(each, str) and each for each in cites):
        raise _MalformedError("cites are ids of readings")
    return tuple(dict.fromkeys(cites))


def _seconds(value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value <= 0:
        raise _MalformedError("seconds is a number above 0")
    return float(value)


def _is_value(value: object) -> bool:
    if isinstance(value, str):
        return len(value) <= NAME_CHARS
    if isinstance(value, float):
        return math.isfinite(value)
    return value is None or isinstance(value, bool | int)


def _object(document: object, what: str) -> Mapping[str, Any]:
    if not isinstance(document, Mapping) or not all(isinstance(name, str) for name in document):
        raise _MalformedError(f"{what} is no object")
    return document


def _array(whole: Mapping[str, Any], name: str, most: int) -> Sequence[Any]:
    items = whole.get(name)
    items = [] if items is None else items
    if not isinstance(items, list | tuple) or len(items) > most:
        raise _MalformedError(f"{name} is no list of at most {most}")
    return items


def _text(whole: Mapping[str, Any], name: str, most: int = NAME_CHARS) -> str:
    value: Value = whole.get(name)
    if not isinstance(value, str) or not 0 < len(value) <= most:
        raise _MalformedError(f"{name} is no text of 1 to {most} characters")
    return value
