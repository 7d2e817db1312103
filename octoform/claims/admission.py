"""The rules by which a proposed claim is believed, kept for a person, or refused: pure, one code for each. Light.

The order is from evidence to effect: what is cited must be known, of the signal, fresh, in favour of the claim and not
outdone by a newer reading; what profiles call clean is clean; what is restricted must be something that may be; and
nobody but a person makes a rule tighter than one that has been found clean before, or makes anything irreversible true.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from octoform.claims.conditions import holds, tighter
from octoform.claims.model import Channel, Claim, Condition, Reading, Restriction, Signal
from octoform.claims.proposal import Proposal
from octoform.claims.readings import Readings
from octoform.claims.settings import READ, Settings, ToolFacts
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.escaping import escaped

PERSON = "person"
MOST_ACTIVE, MOST_PENDING = 64, 16
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
    """What a proposal is judged against, at one moment (``now``: seconds of uptime)."""

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
    """``refused`` says why not; ``waits`` why only a person can; neither: it is believed. ``evidence`` carries it."""

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
        return Verdict(refused=_room(view.pending, MOST_PENDING), waits=waits, evidence=evidence)
    if evidence is None or proposal.condition is None:
        return Verdict(_other_signal(proposal))
    return _weighed(_Case(proposal, proposal.condition, evidence, view), by)


def _weighed(case: _Case, by: str) -> Verdict:
    """What the readings, the profiles, the tools and the claims so far say."""
    view = case.view
    agents = () if by == PERSON else (_within_limits,)
    for rule in (_stale, _unsupported, _outranked, *agents, _restricting, _spent):
        if refused := rule(case):
            return Verdict(refused)
    waits = None if by == PERSON else _ratchet(case) or _always_so(case)
    full = _room(view.active, MOST_ACTIVE) if waits is None else _room(view.pending, MOST_PENDING)
    return Verdict(full, waits, case.evidence)


def outranked(claim: Claim, view: View) -> Diagnostic | None:
    """CLAIM-OUTRANKED when the newest reading contradicts a claim that waits for a person, else None."""
    latest = view.readings.latest(claim.signal)
    return None if latest is None else _contradicts(claim.condition, latest)


def _cited(proposal: Proposal, cited: Sequence[tuple[str, Reading | None]]) -> Diagnostic | None:
    if not cited:
        return error(
            "CLAIM-NO-READING",
            f"the claim about {_shown(proposal.target)} cites no reading",
            hint="cite the ids of the readings at which its condition holds",
        )
    unknown = [name for name, reading in cited if reading is None]
    if unknown:
        return error(
            "CLAIM-UNKNOWN-READING",
            f"there is no reading {_shown(unknown[0])}, which the claim about {_shown(proposal.target)} cites",
            hint="cite only ids that were given; old readings are forgotten",
        )
    return None


def _other_signal(proposal: Proposal) -> Diagnostic:
    assert proposal.signal is not None
    return error(
        "CLAIM-OTHER-SIGNAL",
        f"no reading that the claim about {_shown(proposal.target)} cites is one of {_of(proposal.signal)}",
        hint="a claim stands on readings of its own signal",
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
        f"the newest reading {latest.id} says otherwise: {_value(latest)}, so {_words(condition)} does not hold",
        hint="what is measured outranks what was concluded before",
    )


def _within_limits(case: _Case) -> Diagnostic | None:
    for bound in case.view.settings.bounds_of(case.evidence.signal):
        if (why := bound.calls_clean(case.condition, case.evidence.value)) is not None:
            return error(
                "CLAIM-WITHIN-LIMITS",
                f"{_words(case.condition)} calls trouble what is none at {_of(case.evidence.signal)}: {why}",
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
            return error("CLAIM-UNKNOWN-TOOL", f"there is no tool {_shown(each.tool)} to restrict", hint=hint)
        if facts.effect == READ or facts.stops:
            kind = "a tool that stops a movement" if facts.stops else "a reading"
            return error(
                "CLAIM-RESTRICTS-READING",
                f"{each.tool} is {kind}, which nothing may ever restrict",
                hint="restrict what moves; without readings nobody could take a claim back",
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
        return f"{restriction.tool} does not use {_shown(device)}, which the claim is about"
    if len(facts.devices) > 1 and "device" in facts.choices and restriction.arguments.get("device") != device:
        return f"{restriction.tool} is restricted for all of its devices, not for {_shown(device)} alone"
    for name, choices in facts.choices.items():
        if unit and unit in choices and restriction.arguments.get(name) != unit:
            return f"{restriction.tool} is restricted for more than {_shown(unit)}: {name} can name it alone"
    return None


def _spent(case: _Case) -> Diagnostic | None:
    """What is restricted grows only with a reading that has carried no restriction before."""
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
    """A condition that has never been otherwise would restrict for ever, and nobody could tell that it is over."""
    condition, signal = case.condition, case.evidence.signal
    if not case.proposal.restrictions or signal.channel in _ABOUT_THEMSELVES:
        return None
    if any(bound.says_trouble(case.evidence.value) for bound in case.view.settings.bounds_of(signal)):
        return None
    if case.view.readings.ever_otherwise(signal, condition):
        return None
    return error(
        "CLAIM-ALWAYS-SO",
        f"{_words(condition)} has held at every reading of {_of(signal)}, so nothing tells when it would be over",
        hint="only a person restricts for what has never been otherwise: octoform confirm",
    )


def _irreversible(proposal: Proposal) -> Diagnostic:
    return error(
        "CLAIM-IRREVERSIBLE",
        f"{proposal.irreversible} of {_shown(proposal.target)} is a permanent restriction, so it waits for a person",
        hint="octoform claims shows it; octoform confirm makes it true, octoform confirm -reject refuses it",
    )


def _room(claims: Sequence[Claim], most: int) -> Diagnostic | None:
    if len(claims) < most:
        return None
    return error("CLAIM-TOO-MANY", f"there are {len(claims)} claims already, of at most {most}", hint="octoform claims")


def key_of(restriction: Restriction) -> tuple[str, str, str]:
    """What tells one restriction from another."""
    arguments = sorted((name, repr(value)) for name, value in restriction.arguments.items())
    return restriction.tool, repr(arguments), restriction.effect


def _moment(reading: Reading) -> float:
    return reading.uptime


def _words(condition: Condition) -> str:
    return f"{condition.op} {_shown(str(condition.value))}"


def _of(signal: Signal) -> str:
    return f"{_shown(signal.source)} {_shown(signal.path)}"


def _value(reading: Reading) -> str:
    if reading.value is None:
        return f"it could not be read ({_shown(reading.why) or 'nobody said why'})"
    return f"{_of(reading.signal)} is {_shown(str(reading.value))}"


def _shown(text: str) -> str:
    return escaped(text)[:120]
