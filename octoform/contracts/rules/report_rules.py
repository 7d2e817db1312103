"""Rules that the reports of both duties share: what they rest on, what they name, and that they hand on no orders.

An agent that has read a log for minutes believes it. So nothing in its report counts that the input does not bear out:
each error, claim and declaration cites what was given, about the very thing that it speaks of.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.conditions import holds, untestable
from octoform.contracts.model import Artifacts, JsonObject, Rule, RuleCheck
from octoform.contracts.report_context import SENSOR, DutyFacts, Place, place_of
from octoform.contracts.rules.step_rules import properties, tool, tools_of
from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.patterns import regex
from octoform.records import dataclass

Found = list[Diagnostic]
_ORDERS = regex(
    r"\b[a-z][a-z0-9+.-]{1,20}://\S|"
    r"(?<![\w.-])(?:sudo|curl|wget|chmod|chown|pip3?\s+install|apt(?:-get)?\s+install|rm\s+-|(?:ba|z)?sh\s+-c)(?![\w-])",
    re.IGNORECASE,
)
_WORDS = ("summary", "message", "suggested_fix", "statement", "reason", "seen")


@dataclass(frozen=True, slots=True)
class Target:
    """The target of a claim, in its parts: a device with perhaps one unit, a tool, or (both None) the endpoint."""

    device: str | None = None
    unit: str | None = None
    tool: str | None = None

    @classmethod
    def of(cls, text: str) -> "Target":
        """The parts of ``device:ID/UNIT``, ``device:ID``, ``tool:NAME`` or ``endpoint``."""
        kind, _, name = text.partition(":")
        if kind == "tool":
            return cls(tool=name)
        if kind != "device":
            return cls()
        device, _, unit = name.partition("/")
        return cls(device, unit or None)


def facts_of(artifacts: Artifacts) -> DutyFacts:
    """The facts of the background task; ValueError without them, which no user can cause."""
    if artifacts.duty is None:
        raise ValueError("a report cannot be checked without what its agent was given")
    return artifacts.duty


def known_tools(artifacts: Artifacts) -> list[str]:
    """The names of all tools."""
    return [item["name"] for item in (artifacts.interface or {"tools": []})["tools"]]


def known_devices(artifacts: Artifacts) -> list[str]:
    """The ids of all devices that have a tool or were given."""
    served = [device for item in (artifacts.interface or {"tools": []})["tools"] for device in item["devices"]]
    return list(dict.fromkeys([*served, *(str(row["id"]) for row in facts_of(artifacts).devices)]))


def unknown_reading(code: str) -> RuleCheck:
    """Whatever is cited was given."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        known = facts_of(artifacts).ids()
        found = []
        for where, cites in citations(value):
            for index, identity in enumerate(cites):
                if identity not in known:
                    near = did_you_mean(identity, known)
                    hint = f"did you mean {near}?" if near else "cite ids of readings and failures of input.json"
                    summary = f"there is no reading or failure {display(identity)}"
                    found.append(error(code, summary, pointer=f"{where}{pointer('cites', index)}", hint=hint))
        return found

    return check


def unknown_name(code: str) -> RuleCheck:
    """Tools, devices and units that are named exist, and belong to each other."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for index, item in enumerate(value.get("errors", ())):
            for summary, member, hint in _misnamed(item, artifacts):
                found.append(error(code, summary, pointer=pointer("errors", index, member), hint=hint))
        for part in ("claims", "declarations"):
            for index, item in enumerate(value.get(part, ())):
                for summary, hint in _no_target(item["target"], artifacts):
                    found.append(error(code, summary, pointer=pointer(part, index, "target"), hint=hint))
        return found

    return check


def _misnamed(item: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, str, str]]:
    name, device = item["tool"], item["device"]
    tools, devices = known_tools(artifacts), known_devices(artifacts)
    if name is not None and name not in tools:
        yield f"there is no tool {display(name)}", "tool", _near(name, tools)
    elif device is not None and device not in devices:
        yield f"there is no device {display(device)}", "device", _near(device, devices)
    elif name is not None and device is not None and name not in _names(tools_of(artifacts, device)):
        hint = f"its tools are {listed(_names(tools_of(artifacts, device)))}"
        yield f"the tool {display(name)} does not serve {display(device)}", "device", hint


def _no_target(text: str, artifacts: Artifacts) -> Iterator[tuple[str, str]]:
    target = Target.of(text)
    tools, devices = known_tools(artifacts), known_devices(artifacts)
    if target.tool is not None and target.tool not in tools:
        yield f"there is no tool {display(target.tool)}", _near(target.tool, tools)
    elif target.device is not None and target.device not in devices:
        yield f"there is no device {display(target.device)}", _near(target.device, devices)
    elif target.unit is not None and target.unit not in (known := units_of(target.device or "", artifacts)):
        yield f"{display(target.device)} has no unit {display(target.unit)}", _near(target.unit, known)


def units_of(device: str, artifacts: Artifacts) -> list[str]:
    """Everything that could be a unit of a device: the choices of its tools' parameters, and parts of its readings."""
    served = tools_of(artifacts, device)
    found = [
        one
        for item in served
        for schema in properties(item).values()
        if isinstance(schema, dict)
        for one in (schema.get("enum") or ())
        if isinstance(one, str)
    ]
    for row in facts_of(artifacts).readings:
        if row["channel"] == SENSOR and row["source"] in _names(served):
            found += [part for part in str(row["path"]).split("/") if part and not part.isdigit()]
    return list(dict.fromkeys(found))


def cites_elsewhere(code: str) -> RuleCheck:
    """An error about a tool or a device cites something about it."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for index, item in enumerate(value["errors"]):
            wanted = concerned(item["tool"], item["device"], artifacts)
            if wanted and not any(source_of(one, artifacts) in wanted for one in item["cites"]):
                summary = f"nothing that is cited is about {display(item['tool'] or item['device'])}"
                hint = "cite a reading or a failure of that tool or device, or name what your evidence is about"
                found.append(error(code, summary, pointer=pointer("errors", index, "cites"), hint=hint))
        return found

    return check


def concerned(name: str | None, device: str | None, artifacts: Artifacts) -> set[str]:
    """The sources about a tool or, where none is named, of a device: itself and its tools."""
    if name is not None:
        return {name, *((device,) if device is not None else ())}
    return {device, *_names(tools_of(artifacts, device))} if device is not None else set()


def sources_of(target: Target, artifacts: Artifacts) -> set[str]:
    """The sources about a target: a tool and its devices, a device and its tools, or the endpoint.

    A tool of several devices is read for each of them, and its readings are of ``tool(device)``.
    """
    if target.tool is not None:
        held = tool(artifacts, target.tool)
        devices = held["devices"] if held is not None else ()
        return {target.tool, *devices, *(f"{target.tool}({each})" for each in devices)}
    if target.device is not None:
        names = _names(tools_of(artifacts, target.device))
        return {target.device, *names, *(f"{each}({target.device})" for each in names)}
    return {"endpoint"}


def about(identity: str, target: Target, artifacts: Artifacts) -> bool:
    """Whether a reading or a failure is about a target; of a unit, only readings that name it are."""
    row = facts_of(artifacts).reading(identity)
    if source_of(identity, artifacts) not in sources_of(target, artifacts):
        return False
    return target.unit is None or (row is not None and target.unit in str(row["path"]).split("/"))


def source_of(identity: str, artifacts: Artifacts) -> str | None:
    """The tool or device that a reading or a failure is of; None for an unknown id."""
    facts = facts_of(artifacts)
    row, failed = facts.reading(identity), facts.failure(identity)
    return str(row["source"]) if row is not None else (str(failed["tool"]) if failed is not None else None)


def orders(code: str) -> RuleCheck:
    """No text of a report holds an address or a command: anyone who reads it next might follow it."""

    def check(value: Any, _: Artifacts) -> Found:
        found = []
        for where, text in prose_of(value, ""):
            hit = _ORDERS.search(text)
            if hit is not None:
                hint = "describe what is wrong and what would be right; name no command and no address"
                summary = f"the report hands on {display(hit.group(), 40)}"
                found.append(error(code, summary, pointer=where, hint=hint))
        return found

    return check


def citations(value: JsonObject) -> Iterator[tuple[str, list[str]]]:
    """(pointer of the object, ids) of everything in a report that cites."""
    if "cites" in value:
        yield "", value["cites"]
    for part in ("errors", "claims", "declarations"):
        for index, item in enumerate(value.get(part, ())):
            yield pointer(part, index), item["cites"]


def foreign_restriction(item: JsonObject, target: Target, artifacts: Artifacts) -> tuple[str, str, str] | None:
    """Why a restriction concerns more than the claim's target: summary, member, hint; None when it does not."""
    held = tool(artifacts, item["tool"])
    if held is None:
        return f"there is no tool {display(item['tool'])}", "tool", _near(item["tool"], known_tools(artifacts))
    given, known = item["arguments"], properties(held)
    strange = next((name for name in given if name not in known), None)
    if strange is not None:
        return f"{display(item['tool'])} has no parameter {display(strange)}", "arguments", _near(strange, list(known))
    if target.tool is not None and target.tool != item["tool"]:
        return (
            f"the claim is about {display(target.tool)}, and restricts {display(item['tool'])}",
            "tool",
            "leave it out",
        )
    if target.device is None:
        return None if target.tool else ("a claim about the endpoint restricts no tool", "tool", "leave it out")
    if target.device not in held["devices"]:
        return (
            f"{display(item['tool'])} does not serve {display(target.device)}",
            "tool",
            "restrict a tool of that device",
        )
    for name, schema in known.items():
        choices = schema.get("enum") if isinstance(schema, dict) else None
        for part in (target.device if len(held["devices"]) > 1 else None, target.unit):
            if part is not None and part in (choices or ()) and given.get(name) != part:
                summary = f"{display(item['tool'])} is restricted for more than {display(part)}"
                return summary, "arguments", f"add {name}: {part}"
    return None


def _near(name: str, known: list[str]) -> str:
    near = did_you_mean(name, known)
    return f"did you mean {near}?" if near else f"there are {listed(known)}" if known else "there is none"


def _names(tools: list[JsonObject]) -> list[str]:
    return [item["name"] for item in tools]


def prose_of(value: Any, where: str) -> Iterator[tuple[str, str]]:
    """(pointer, text) of every member that is prose."""
    if isinstance(value, dict):
        for name, item in value.items():
            place = where + pointer(name)
            if name in _WORDS and isinstance(item, str):
                yield place, item
            yield from prose_of(item, place)
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from prose_of(item, where + pointer(index))


# Rules for what a report claims: a condition that readings bear out now, and that the next one can refute.
#
# The ledger judges each claim again, against all that it knows; but an agent that hears of a slip here can still fix
# it. Nothing is ever tightened on old words: a claim without a reading of its own signal is none.


def rules(stage: str) -> tuple[Rule, ...]:
    """The rules for the claims of one background task, with codes of its own."""
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
                    continue  # a rule of its own reports an unknown one
                summary = f"{display(identity)} is no reading of {_signal(claim)}"
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
            summary = f"{_signal(claim)} is no signal of {display(claim['target'])}"
            hint = "claim only of that whose signal you read" if fit else "name the tool or the device that it is of"
            found.append(error(code, summary, pointer=where + "/signal", hint=hint))
        return found

    return check


def _untestable(code: str) -> RuleCheck:
    """A reading that is in order would refute the condition."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        facts, found = facts_of(artifacts), []
        for where, claim in _claims(value):
            op, wanted = claim["condition"]["op"], claim["condition"]["value"]
            why = untestable(op, wanted) or _too_wide(value, claim, facts)
            if why is not None:
                summary = f"no reading would refute {_words(claim)}: {why}"
                hint = "write the condition so that a reading in order makes it false"
                found.append(error(code, summary, pointer=where + "/condition", hint=hint))
        return found

    return check


_RISING, _FALLING = (">", ">="), ("<", "<=")
_NO_QUANTITY = frozenset({"value", "raw", "reading", "state", "count"})
"""Last words of paths that do not name what is measured, so that two of them need not be alike."""


def _too_wide(value: Any, claim: Any, facts: DutyFacts) -> str | None:
    """Why a bound would hold at readings in order too: at an alike unit of which nothing is wrong, or at any amount."""
    op, wanted = claim["condition"]["op"], claim["condition"]["value"]
    place = place_of(claim["signal"])
    newest = facts.newest_value(place)
    if op not in (*_RISING, *_FALLING) or type(wanted) not in (int, float) or type(newest) not in (int, float):
        return None
    former = (row["value"] for row in facts.readings if place_of(row) == place)
    is_amount = not any(type(each) in (int, float) and each < 0 for each in former)
    if is_amount and op in _RISING and newest > 0 and (wanted < 0 or (wanted == 0 and op == ">=")):
        return f"it is {display(newest)}, and an amount of nothing would do"
    held = {place_of(item["signal"]) for _, item in _claims(value)}
    held |= {place_of(item["signal"]) for item in facts.claims if isinstance(item.get("signal"), Mapping)}
    cited = {identity for item in value.get("errors", ()) for identity in item["cites"]}
    for other, row in facts.newest().items():
        known = type(row["value"]) in (int, float) and other not in held and row["id"] not in cited
        within = known and _are_alike(place, other) and min(wanted, newest) <= row["value"] <= max(wanted, newest)
        if within and Target.of(claim["target"]).unit is not None and _true(claim, row["value"]) is True:
            return f"{' '.join(other)} is {display(row['value'])}, and nothing is reported of it"
    return None


def _are_alike(one: Place, two: Place) -> bool:
    """Whether two signals are the same quantity of two units of one device."""
    first, second = one[2].split("/"), two[2].split("/")
    if one == two or one[:2] != two[:2] or len(first) != len(second) or first[-1] != second[-1]:
        return False
    return first[-1] not in _NO_QUANTITY and sum(a != b for a, b in zip(first, second, strict=True)) == 1


def _not_supported(code: str) -> RuleCheck:
    """The condition is true at each reading that is cited."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        facts, found = facts_of(artifacts), []
        for where, claim in _claims(value):
            for index, identity in enumerate(claim["cites"]):
                row = facts.reading(identity)
                if row is None or _true(claim, row["value"]) is True:
                    continue
                read = "could not be read" if row["value"] is None else f"is {display(row['value'])}"
                summary = f"{_words(claim)} does not hold at {display(identity)}, which {read}"
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
                summary = f"the newest reading of {_signal(claim)} is {display(newest)}, so {_words(claim)} is over"
                hint = "leave the claim out: what is measured now outranks what was measured before"
                found.append(error(code, summary, pointer=where + "/condition", hint=hint))
        return found

    return check


def _restricts_reading(code: str) -> RuleCheck:
    """A claim must not restrict tools that read or stop: they show the end of the problem, or end a movement."""

    def check(value: Any, artifacts: Artifacts) -> Found:
        found = []
        for where, item, _ in _restrictions(value):
            held = tool(artifacts, item["tool"])
            if held is not None and (held["effect"] == "read" or held.get("stops", False)):
                does = "stops" if held.get("stops", False) else "reads"
                summary = f"{display(item['tool'])} {does}, and is never restricted"
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
    return f"{claim['condition']['op']} {display(claim['condition']['value'], 40)}"


def _signal(claim: JsonObject) -> str:
    channel, source, path = place_of(claim["signal"])
    return listed([f"{channel} {source} {path}"])
