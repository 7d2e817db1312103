"""Rules for what a report claims: a condition that readings bear out now, and that the next one can refute.

The ledger judges each claim again, against all that it knows; but an agent that hears of a slip here can still mend it.
Nothing is ever tightened on old words: a claim without a reading of its own signal is none.
"""

from collections.abc import Callable, Iterator
from typing import Any

from octoform.conditions import holds, untestable
from octoform.contracts.duties import place_of
from octoform.contracts.model import Artifacts, JsonObject, Rule, RuleCheck
from octoform.contracts.report_rules import Found, Target, facts_of, foreign_restriction, sources_of
from octoform.contracts.step_tools import tool
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import error


def rules(stage: str) -> tuple[Rule, ...]:
    """The rules for the claims of one duty, with codes of its own."""
    return (
        _rule(f"{stage}-CLAIM-OTHER-SIGNAL", _other_signal),
        _rule(f"{stage}-CLAIM-ELSEWHERE", _elsewhere),
        _rule(f"{stage}-CLAIM-UNTESTABLE", _untestable),
        _rule(f"{stage}-CLAIM-NOT-SUPPORTED", _not_supported),
        _rule(f"{stage}-CLAIM-OUTRANKED", _outranked),
        _rule(f"{stage}-RESTRICTS-READING", _restricts_reading),
        _rule(f"{stage}-RESTRICTS-MORE", _restricts_more),
    )


def _rule(code: str, make: Callable[[str], RuleCheck]) -> Rule:
    return Rule(code, make(code))


def _other_signal(code: str) -> RuleCheck:
    """A claim cites readings of the signal that it is about, nothing else."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        facts, found = facts_of(artifacts), []
        for where, claim in _claims(value):
            for index, identity in enumerate(claim["cites"]):
                row = facts.reading(identity)
                known = row is not None or facts.failure(identity) is not None
                if not known or (row is not None and place_of(row) == place_of(claim["signal"])):
                    continue  # an unknown one is told by a rule of its own
                summary = f"{shown(identity)} is no reading of {_signal(claim)}"
                hint = "cite readings of the claim's own signal, spelt as they have it"
                found.append(error(code, summary, pointer=where + pointer("cites", index), hint=hint))
        return found

    return check


def _elsewhere(code: str) -> RuleCheck:
    """The signal is one of the target: of the tool, of the device or its tools, and of the very unit."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for where, claim in _claims(value):
            target, (_, source, path) = Target.of(claim["target"]), place_of(claim["signal"])
            fit = source in sources_of(target, artifacts)
            if fit and (target.unit is None or target.unit in path.split("/")):
                continue
            summary = f"{_signal(claim)} says nothing about {shown(claim['target'])}"
            hint = "claim only of that whose signal you read" if fit else "name the tool or the device that it is of"
            found.append(error(code, summary, pointer=where + "/signal", hint=hint))
        return found

    return check


def _untestable(code: str) -> RuleCheck:
    """A reading could refute the condition."""

    def check(value: Any, _: Artifacts) -> Found:
        found = []
        for where, claim in _claims(value):
            op, wanted = claim["condition"]["op"], claim["condition"]["value"]
            why = untestable(op, wanted)
            if why is not None:
                summary = f"no reading would refute {_words(claim)}: {why}"
                hint = "write the condition so that a reading in order makes it false"
                found.append(error(code, summary, pointer=where + "/condition", hint=hint))
        return found

    return check


def _not_supported(code: str) -> RuleCheck:
    """The condition is true at each reading that is cited."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        facts, found = facts_of(artifacts), []
        for where, claim in _claims(value):
            for index, identity in enumerate(claim["cites"]):
                row = facts.reading(identity)
                if row is None or _true(claim, row["value"]) is True:
                    continue
                read = "could not be read" if row["value"] is None else f"is {shown(row['value'])}"
                summary = f"{_words(claim)} does not hold at {shown(identity)}, which {read}"
                hint = "cite readings at which it holds; absence is unknown, and nothing is claimed on it"
                found.append(error(code, summary, pointer=where + pointer("cites", index), hint=hint))
        return found

    return check


def _outranked(code: str) -> RuleCheck:
    """The newest reading of the signal does not say otherwise."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        facts, found = facts_of(artifacts), []
        for where, claim in _claims(value):
            newest = facts.newest_value(place_of(claim["signal"]))
            if _true(claim, newest) is False:
                summary = f"the newest reading of {_signal(claim)} is {shown(newest)}, so {_words(claim)} is over"
                hint = "leave the claim out: what is measured now outranks what was measured before"
                found.append(error(code, summary, pointer=where + "/condition", hint=hint))
        return found

    return check


def _restricts_reading(code: str) -> RuleCheck:
    """What reads or stops stays open: nobody could learn otherwise that the trouble is over, or end a movement."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for where, item, _ in _restrictions(value):
            held = tool(artifacts, item["tool"])
            if held is not None and (held["effect"] == "read" or held.get("stops", False)):
                does = "stops" if held.get("stops", False) else "reads"
                summary = f"{shown(item['tool'])} {does}, and is never restricted"
                found.append(error(code, summary, pointer=where + "/tool", hint="restrict only what actuates"))
        return found

    return check


def _restricts_more(code: str) -> RuleCheck:
    """A claim restricts what it is about, and nothing beside it."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for where, item, claim in _restrictions(value):
            problem = foreign_restriction(item, Target.of(claim["target"]), artifacts)
            if problem is not None:
                summary, member, hint = problem
                found.append(error(code, summary, pointer=where + pointer(member), hint=hint))
        return found

    return check


def _claims(value: JsonObject) -> Iterator[tuple[str, JsonObject]]:
    for index, claim in enumerate(value["claims"]):
        yield pointer("claims", index), claim


def _restrictions(value: JsonObject) -> Iterator[tuple[str, JsonObject, JsonObject]]:
    for where, claim in _claims(value):
        for index, item in enumerate(claim["restrictions"]):
            yield where + pointer("restrictions", index), item, claim


def _true(claim: JsonObject, value: object) -> bool | None:
    return holds(claim["condition"]["op"], claim["condition"]["value"], value)


def _words(claim: JsonObject) -> str:
    return f"{claim['condition']['op']} {shown(claim['condition']['value'], 40)}"


def _signal(claim: JsonObject) -> str:
    channel, source, path = place_of(claim["signal"])
    return listed([f"{channel} {source} {path}"])
