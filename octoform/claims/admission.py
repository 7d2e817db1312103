"""The rules by which a proposed claim is believed, kept for a person, or refused: pure, one code for each. Light.

The order is from evidence to effect: what is cited must be known, of the signal, fresh, in favour of the claim and not
outdone by a newer reading; what profiles call clean is clean; what is restricted must be something that may be; and
no one but a person makes a rule tighter than one that has been found clean before, or makes anything irreversible true.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from octoform.base.escaping import escaped
from octoform.claims.model import Channel, Claim, Condition, Reading, Restriction, Signal, Value, holds, tighter
from octoform.claims.readings import Readings
from octoform.claims.settings import READ, Settings, ToolFacts
from octoform.conditions import OPERATORS
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.records import dataclass, field

# A claim as somebody would like it: checked for its shape here, for its truth by the ledger. Light.
#
# Agents write proposals as JSON. What does not have the form is reported as CLAIM-MALFORMED and nothing of it is used.

DECLARATIONS = ("terminal_lock", "disable_unit", "fire_risk")
EFFECTS = ("deny", "confirm")
MAX_CITES, MAX_RESTRICTIONS, MAX_ARGUMENTS = 32, 32, 16
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
    """The problem, for a person."""


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
            restrictions=tuple(_restriction(item) for item in _array(whole, "restrictions", MAX_RESTRICTIONS)),
        )
    except _MalformedError as problem:
        return malformed(str(problem))


def of_declaration(document: object) -> Proposal | Diagnostic:
    """The proposal in one of WATCH's ``declarations``; CLAIM-MALFORMED when it has another form."""
    try:
        whole = _object(document, "a permanent restriction")
        kind = _text(whole, "kind")
        if kind not in DECLARATIONS:
            raise _MalformedError(
                f"a permanent restriction is one of {', '.join(DECLARATIONS)}, not {escaped(kind)[:60]!r}"
            )
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
            raise _MalformedError(f"a permanent restriction is one of {', '.join(DECLARATIONS)}")
        if condition is not None:
            _condition({"op": condition.op, "value": condition.value})
        _seconds(proposal.seconds)
        if len(proposal.cites) > MAX_CITES or len(proposal.restrictions) > MAX_RESTRICTIONS:
            raise _MalformedError(f"at most {MAX_CITES} cites and {MAX_RESTRICTIONS} restrictions")
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
        raise _MalformedError("a condition compares with a number, a truth value or a string")
    return Condition(str(op), value)


def _restriction(document: object) -> Restriction:
    whole = _object(document, "a restriction")
    arguments = _object(whole.get("arguments") or {}, "arguments")
    effect = whole.get("effect", "deny")
    if effect not in EFFECTS:
        raise _MalformedError(f"a restriction's effect is one of {', '.join(EFFECTS)}")
    if len(arguments) > MAX_ARGUMENTS or not all(_is_value(value) for value in arguments.values()):
        raise _MalformedError(f"a restriction has at most {MAX_ARGUMENTS} arguments, each a plain value")
    return Restriction(_text(whole, "tool"), dict(arguments), str(effect))


def _cites(whole: Mapping[str, Any]) -> tuple[str, ...]:
    cites = _array(whole, "cites", MAX_CITES)
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


PERSON = "person"
MAX_ACTIVE, MAX_PENDING = 64, 16
_ABOUT_THEMSELVES = (Channel.LOG, Channel.KERNEL, Channel.PROCESS)
"""Channels whose values say by themselves whether they are good: a call fails, a device is not there."""


@dataclass(frozen=True, slots=True)
class Level:
    """The condition of an earlier claim: agents get none on this signal that is tighter."""

    signal: Signal
    condition: Condition
    claim: str
    clean: Reading | None = None
    """The reading at which it was found clean."""


@dataclass(frozen=True, slots=True)
class View:
    """The context in which a proposal is judged, at one moment (``now``: seconds of uptime)."""

    now: float
    settings: Settings
    readings: Readings
    active: Sequence[Claim] = ()
    pending: Sequence[Claim] = ()
    levels: Sequence[Level] = ()
    spent: Mapping[Signal, float] = field(default_factory=dict)
    """Up to which moment the readings of a signal have carried restrictions."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """``refused`` states why not; ``waits`` why only a person can; neither: it is believed. ``evidence`` carries it."""

    refused: Diagnostic | None = None
    waits: Diagnostic | None = None
    evidence: Reading | None = None


@dataclass(frozen=True, slots=True)
class _Case:
    """A proposal about a signal with the newest reading that it cites of it."""

    proposal: Proposal
    condition: Condition
    evidence: Reading
    view: View


def judge(proposal: Proposal, by: str, view: View) -> Verdict:
    """Whether a proposal of well-formed shape is believed; changes nothing."""
    cited = [(name, view.readings.find(name)) for name in proposal.cites]
    if refused := _cited(proposal, cited):
        return Verdict(refused)
    known = [reading for _, reading in cited if reading is not None]
    mine = [one for one in known if proposal.signal in (None, one.signal)]
    evidence = max(mine, key=_moment, default=None)
    if proposal.irreversible is not None:
        waits = None if by == PERSON else _irreversible(proposal)
        return Verdict(refused=_room(view.pending, MAX_PENDING), waits=waits, evidence=evidence)
    if evidence is None or proposal.condition is None:
        return Verdict(_other_signal(proposal))
    return _weighed(_Case(proposal, proposal.condition, evidence, view), by)


def _weighed(case: _Case, by: str) -> Verdict:
    """Check a proposal against the readings, the profiles, the tools and the claims so far."""
    view = case.view
    agents = () if by == PERSON else (_within_limits,)
    for rule in (_stale, _unsupported, _outranked, *agents, _restricting, _spent):
        if refused := rule(case):
            return Verdict(refused)
    waits = None if by == PERSON else _ratchet(case) or _always_so(case)
    full = _room(view.active, MAX_ACTIVE) if waits is None else _room(view.pending, MAX_PENDING)
    return Verdict(full, waits, case.evidence)


def outranked(claim: Claim, view: View) -> Diagnostic | None:
    """CLAIM-OUTRANKED when the newest reading contradicts a claim that waits for a person, else None."""
    latest = view.readings.latest(claim.signal)
    return None if latest is None else _contradicts(claim.condition, latest)


def _cited(proposal: Proposal, cited: Sequence[tuple[str, Reading | None]]) -> Diagnostic | None:
    if not cited:
        return error(
            "CLAIM-NO-READING",
            f"the claim about {_display(proposal.target)} cites no reading",
            hint="cite the ids of the readings at which its condition holds",
        )
    unknown = [name for name, reading in cited if reading is None]
    if unknown:
        return error(
            "CLAIM-UNKNOWN-READING",
            f"there is no reading {_display(unknown[0])}, which the claim about {_display(proposal.target)} cites",
            hint="cite only ids that were given; old readings are forgotten",
        )
    return None


def _other_signal(proposal: Proposal) -> Diagnostic:
    assert proposal.signal is not None
    return error(
        "CLAIM-OTHER-SIGNAL",
        f"no reading that the claim about {_display(proposal.target)} cites is one of {_of(proposal.signal)}",
        hint="a claim rests on readings of its own signal",
    )


def _stale(case: _Case) -> Diagnostic | None:
    age, most = case.view.now - case.evidence.uptime, case.view.settings.claim_seconds
    if age < most:
        return None
    return error(
        "CLAIM-STALE",
        f"the reading {case.evidence.id} is {age:.0f} s old; evidence is at most {most:.0f} s old",
        hint="read the signal again",
    )


def _unsupported(case: _Case) -> Diagnostic | None:
    if holds(case.condition, case.evidence.value) is True:
        return None
    return error(
        "CLAIM-NOT-SUPPORTED",
        f"{_words(case.condition)} does not hold at the reading {case.evidence.id}: {_value(case.evidence)}",
        hint="a condition is true at the reading that is cited",
    )


def _outranked(case: _Case) -> Diagnostic | None:
    latest = case.view.readings.latest(case.evidence.signal)
    if latest is None or latest.uptime < case.evidence.uptime:
        return None
    return _contradicts(case.condition, latest)


def _contradicts(condition: Condition, latest: Reading) -> Diagnostic | None:
    if holds(condition, latest.value) is not False:
        return None
    return error(
        "CLAIM-OUTRANKED",
        f"the newest reading {latest.id} shows the opposite: {_value(latest)}, so {_words(condition)} does not hold",
        hint="what is measured outranks what was concluded before",
    )


def _within_limits(case: _Case) -> Diagnostic | None:
    for bound in case.view.settings.bounds_of(case.evidence.signal):
        if (why := bound.calls_clean(case.condition, case.evidence.value)) is not None:
            return error(
                "CLAIM-WITHIN-LIMITS",
                f"{_words(case.condition)} calls a normal value a problem at {_of(case.evidence.signal)}: {why}",
                hint="the profile knows the product; its bounds are changed there, by a person",
            )
    return None


def _restricting(case: _Case) -> Diagnostic | None:
    tools = case.view.settings.tools
    for each in case.proposal.restrictions:
        facts = tools.get(each.tool)
        if facts is None:
            near = did_you_mean(each.tool, list(tools))
            hint = f"did you mean {near}?" if near else "restrict only tools that the endpoint has"
            return error("CLAIM-UNKNOWN-TOOL", f"there is no tool {_display(each.tool)} to restrict", hint=hint)
        if facts.effect == READ or facts.stops:
            kind = "a tool that stops a movement" if facts.stops else "a reading"
            return error(
                "CLAIM-RESTRICTS-READING",
                f"{each.tool} is {kind}, which nothing may ever restrict",
                hint="restrict what moves; without readings no one could take a claim back",
            )
        if (why := _too_wide(case.proposal.target, each, facts)) is not None:
            return error("CLAIM-TOO-WIDE", why, hint="restrict what the claim is about, and nothing beside it")
    return None


def _too_wide(target: str, restriction: Restriction, facts: ToolFacts) -> str | None:
    """A claim about one device, or one unit of it, leaves the others alone."""
    if not target.startswith("device:"):
        return None
    device, _, unit = target.removeprefix("device:").partition("/")
    if facts.devices and device not in facts.devices:
        return f"{restriction.tool} does not use {_display(device)}, which the claim is about"
    if len(facts.devices) > 1 and "device" in facts.choices and restriction.arguments.get("device") != device:
        return f"{restriction.tool} is restricted for all of its devices, not for {_display(device)} alone"
    for name, choices in facts.choices.items():
        if unit and unit in choices and restriction.arguments.get(name) != unit:
            return f"{restriction.tool} is restricted for more than {_display(unit)}: {name} can name it alone"
    return None


def _spent(case: _Case) -> Diagnostic | None:
    """Restrictions may grow only with a reading that has carried none before."""
    in_force = {key_of(each) for claim in case.view.active for each in claim.restrictions}
    wider = [each for each in case.proposal.restrictions if key_of(each) not in in_force]
    if not wider or case.evidence.uptime > case.view.spent.get(case.evidence.signal, -math.inf):
        return None
    return error(
        "CLAIM-SPENT-READING",
        f"the reading {case.evidence.id} has carried a restriction already, and {wider[0].tool} would be a further one",
        hint="put what follows from one reading into one claim, or read again",
    )


def _ratchet(case: _Case) -> Diagnostic | None:
    condition = case.condition
    for level in case.view.levels:
        if level.signal != case.evidence.signal:
            continue
        clean = level.clean is not None and holds(condition, level.clean.value) is True
        if clean or tighter(condition, level.condition):
            return error(
                "CLAIM-RATCHET",
                f"{_words(condition)} is tighter than {_words(level.condition)} of {level.claim} before it",
                hint="only a person makes it tighter: octoform confirm, or a limit in the manifest",
            )
    return None


def _always_so(case: _Case) -> Diagnostic | None:
    """A condition that has never been otherwise would restrict permanently, and its end could not be observed."""
    condition, signal = case.condition, case.evidence.signal
    if not case.proposal.restrictions or signal.channel in _ABOUT_THEMSELVES:
        return None
    if any(bound.is_problem(case.evidence.value) for bound in case.view.settings.bounds_of(signal)):
        return None
    if case.view.readings.ever_otherwise(signal, condition):
        return None
    return error(
        "CLAIM-ALWAYS-SO",
        f"{_words(condition)} has held at every reading of {_of(signal)}, so no reading can end it",
        hint="only a person restricts for what has never been otherwise: octoform confirm",
    )


def _irreversible(proposal: Proposal) -> Diagnostic:
    return error(
        "CLAIM-IRREVERSIBLE",
        f"{proposal.irreversible} of {_display(proposal.target)} is a permanent restriction, so it waits for a person",
        hint="octoform claims shows it; octoform confirm makes it true, octoform confirm -reject refuses it",
    )


def _room(claims: Sequence[Claim], most: int) -> Diagnostic | None:
    if len(claims) < most:
        return None
    return error("CLAIM-TOO-MANY", f"there are {len(claims)} claims already, of at most {most}", hint="octoform claims")


def key_of(restriction: Restriction) -> tuple[str, str, str]:
    """The identity of a restriction."""
    arguments = sorted((name, repr(value)) for name, value in restriction.arguments.items())
    return restriction.tool, repr(arguments), restriction.effect


def _moment(reading: Reading) -> float:
    return reading.uptime


def _words(condition: Condition) -> str:
    return f"{condition.op} {_display(str(condition.value))}"


def _of(signal: Signal) -> str:
    return f"{_display(signal.source)} {_display(signal.path)}"


def _value(reading: Reading) -> str:
    if reading.value is None:
        return f"it could not be read ({_display(reading.why) or 'no reason was given'})"
    return f"{_of(reading.signal)} is {_display(str(reading.value))}"


def _display(text: str) -> str:
    return escaped(text)[:120]
