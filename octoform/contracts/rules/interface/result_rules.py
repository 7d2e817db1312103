"""Rules for INTERFACE that read the tools' own schemas: valid, typed, bounded, and callable.

Heavy: imports jsonschema. A schema comes from an agent, so nothing in it is fetched, and no pattern of it is run
against text here (a pattern can be written to never end).
"""

import json
from collections.abc import Iterator, Mapping
from fnmatch import fnmatchcase
from functools import lru_cache
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import SchemaError, best_match

from octoform.base.escaping import display, listed
from octoform.base.files import parse
from octoform.base.quantities import unit_in, unit_of_name, unit_of_text
from octoform.base.shape import pointer, resolve
from octoform.contracts.model import Artifacts, JsonObject, Rule, effects_of, is_graver
from octoform.contracts.rules.interface.bound_rules import listed_of, sample_too_long
from octoform.contracts.rules.interface.member_units import units_of_quantity
from octoform.contracts.schema_validation import Problem, validator
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

MAX_UNFOLDED = 5000

_TYPING = frozenset({"type", "enum", "const", "anyOf", "oneOf", "allOf", "$ref"})
_RUNS_A_PATTERN = frozenset({"pattern", "patternProperties", "propertyNames", "format"})


def input_schema(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Every input_schema is a valid 2020-12 schema of type object."""
    return _invalid(value, "input_schema", "INTERFACE-INPUT-SCHEMA")


def output_schema(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Every output_schema is a valid 2020-12 schema of type object."""
    return _invalid(value, "output_schema", "INTERFACE-OUTPUT-SCHEMA")


def untyped_property(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """Every parameter declares its type."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for name, member in _properties(tool).items():
            if not isinstance(member, dict) or not _TYPING & member.keys():
                summary = f"the parameter {display(name)} of {display(tool['name'])} has no type"
                where = pointer("tools", index, "input_schema", "properties", name)
                hint = "give it a type, and its unit and range"
                out.append(error("INTERFACE-UNTYPED-PROPERTY", summary, pointer=where, hint=hint))
    return out


def required_unknown(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A required member of an input_schema or of a result must be among the properties there."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for name in _required(tool):
            if name not in _properties(tool):
                summary = f"{display(tool['name'])} requires the parameter {display(name)}, which it does not have"
                where = pointer("tools", index, "input_schema", "required")
                hint = "add it to properties, or take it out of required"
                out.append(error("INTERFACE-REQUIRED-UNKNOWN", summary, pointer=where, hint=hint))
        for place, name in _absent(tool.get("output_schema"), ("tools", index, "output_schema")):
            summary = f"the result of {display(tool['name'])} requires {display(name)}, which it does not have"
            hint = "describe it in properties, or take it out of required"
            out.append(error("INTERFACE-REQUIRED-UNKNOWN", summary, pointer=pointer(*place), hint=hint))
    return out


def _absent(schema: Any, where: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], str]]:
    """(place, name) of each required member of a result that is not described there, at any depth."""
    if isinstance(schema, list):
        for index, item in enumerate(schema):
            yield from _absent(item, (*where, index))
    elif isinstance(schema, dict):
        members, required = schema.get("properties"), schema.get("required")
        open_ended = schema.get("additionalProperties") or {"anyOf", "oneOf", "allOf", "$ref"} & schema.keys()
        if isinstance(members, dict) and isinstance(required, list) and not open_ended:
            yield from (((*where, "required"), each) for each in map(str, required) if each not in members)
        for name, item in schema.items():
            yield from _absent(item, (*where, name))


def device_parameter(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A tool of several devices has a parameter `device` that lists exactly them; what acts requires it."""
    out = []
    for index, tool in enumerate(value["tools"]):
        member = _properties(tool).get("device")
        where = pointer("tools", index, "input_schema", "properties")
        if member is None and len(tool["devices"]) > 1:
            summary = f"{display(tool['name'])} serves {len(tool['devices'])} devices and has no parameter `device`"
        elif member is not None and _choices(member, tool) != set(tool["devices"]):
            summary = f"the parameter `device` of {display(tool['name'])} does not list exactly the tool's devices"
            where += "/device"
        elif tool["effect"] != "read" and len(tool["devices"]) > 1 and "device" not in _required(tool):
            summary = f"{display(tool['name'])} chooses among its devices where a caller names none"
            where = pointer("tools", index, "input_schema", "required")
        else:
            continue
        hint = "make `device` a required string with an enum of the device ids in `devices`"
        out.append(error("INTERFACE-DEVICE-PARAMETER", summary, pointer=where, hint=hint))
    return out


def limit_missing(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each limit of a profile in force is in the tool that it concerns."""
    out = []
    for index, tool, wanted, profile in _profile_limits(value, artifacts):
        if _limit_of(tool, wanted["parameter"]) is None:
            summary = (
                f"{display(tool['name'])} lacks the limit of {display(wanted['parameter'])} from {display(profile)}"
            )
            where = pointer("tools", index, "limits")
            hint = f"add {_range(wanted)}"
            out.append(error("INTERFACE-LIMIT-MISSING", summary, pointer=where, hint=hint))
    return out


def limit_wider(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No limit is wider than the profile's, or in another unit; without a profile none is wider than the argument."""
    out = []
    for index, tool, wanted, profile in _profile_limits(value, artifacts):
        has = _limit_of(tool, wanted["parameter"])
        if has is not None and not _within(has, wanted):
            summary = f"{_range(has)} of {display(tool['name'])} is not within {_range(wanted)} of {display(profile)}"
            where = pointer("tools", index, "limits")
            hint = "keep both bounds and the unit of the profile, or narrow them"
            out.append(error("INTERFACE-LIMIT-WIDER", summary, pointer=where, hint=hint))
    known = {(index, wanted["parameter"]) for index, _, wanted, _ in _profile_limits(value, artifacts)}
    for index, tool in enumerate(value["tools"]):
        for at, limit in enumerate(tool.get("limits", ())):
            own = _properties(tool).get(limit["parameter"])
            if isinstance(own, dict) and (index, limit["parameter"]) not in known and _is_wider(limit, own):
                summary = f"{_range(limit)} of {display(tool['name'])} is not within the range that the argument has"
                where = pointer("tools", index, "limits", at)
                hint = "write the minimum and maximum of input_schema, or narrower ones"
                out.append(error("INTERFACE-LIMIT-WIDER", summary, pointer=where, hint=hint))
    return out


def _is_wider(limit: JsonObject, member: JsonObject) -> bool:
    """Whether a side of a limit lies beyond the bound that the argument's schema has on that side."""
    low, high = limit.get("minimum"), limit.get("maximum")
    least, most = member.get("minimum"), member.get("maximum")
    below = isinstance(low, int | float) and isinstance(least, int | float) and low < least
    return below or (isinstance(high, int | float) and isinstance(most, int | float) and high > most)


_PROFILE = regex(r"\bprofile[: ]+['\"`]?([a-z][\w-]+)")


def limit_empty(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A limit bounds something: at least one side, the lower not above the upper, of a parameter that exists."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for at, limit in enumerate(tool.get("limits", ())):
            low, high = limit.get("minimum"), limit.get("maximum")
            if low is None and high is None:
                why = "has neither a minimum nor a maximum"
            elif low is not None and high is not None and low > high:
                why = f"allows nothing: {low} is above {high}"
            elif limit["parameter"] not in _properties(tool):
                why = "is of a parameter that the tool does not have"
            elif limit != _limit_of(tool, limit["parameter"]):
                why = "is there twice, with other bounds"
            elif (named := _PROFILE.search(limit.get("source", ""))) and named[1] not in artifacts.profiles:
                why = f"is from a profile that is not chosen: {display(named[1])}"
            else:
                continue
            summary = f"the limit of {display(limit['parameter'])} in {display(tool['name'])} {why}"
            where = pointer("tools", index, "limits", at)
            hint = "write one limit for a parameter of the tool, with the bounds of its schema or narrower ones"
            out.append(error("INTERFACE-LIMIT-EMPTY", summary, pointer=where, hint=hint))
    return out


def smoke_arguments(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A read tool can be called once for a test, briefly: its smoke arguments, or none, fit its input_schema."""
    effects = effects_of(artifacts)
    out = sample_too_long(value)
    for index, tool in enumerate(value["tools"]):
        where = pointer("tools", index, "smoke")
        if is_graver(effects.get(tool["capability"], tool["effect"]), tool["effect"]):
            continue  # another rule's finding, and the cause of this one
        if tool["effect"] != "read":
            if "smoke" in tool:
                summary = f"{display(tool['name'])} is no read tool and may not be called for a test"
                out.append(error("INTERFACE-SMOKE", summary, pointer=where, hint="take smoke out"))
            continue
        if "smoke" not in tool:
            summary = f"{display(tool['name'])} reads and has no test call"
            hint = 'write "smoke": {"arguments": {...}} with harmless arguments; {} where a call needs none'
            out.append(error("INTERFACE-SMOKE", summary, pointer=pointer("tools", index), hint=hint))
            continue
        arguments = tool["smoke"]["arguments"]
        problem = _misfit(arguments, tool["input_schema"])
        if problem is not None:
            summary = f"{display(tool['name'])} cannot be called for a test: its smoke arguments do not fit the "
            summary += "input_schema"
            hint = "give harmless arguments that the input_schema accepts"
            out.append(error("INTERFACE-SMOKE", summary, pointer=where, detail=problem, hint=hint))
    return out


def channel_unit(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading of a chip's channels is in a unit of the quantity that they have by IDENTIFY."""
    out = []
    for index, tool in enumerate(value["tools"]):
        channels = [row.get("unit") for _, row in listed_of(tool, artifacts)] if tool["effect"] == "read" else []
        known = {unit_of_text(unit) for unit in channels}
        if tool["effect"] == "read" and not channels:
            known = {*units_of_quantity(tool["capability"])}
        given = set(_units_in(tool.get("output_schema")))
        if not known or not given or None in known | given or set(map(_quantity, known)) & set(map(_quantity, given)):
            continue
        summary = f"the result of {display(tool['name'])} is in {_told(given)}, and what it reads is in "
        summary += _told(known)
        hint = "return what the channels measure; another quantity is another capability, in IDENTIFY first"
        where = pointer("tools", index, "output_schema")
        out.append(error("INTERFACE-CHANNEL-UNIT", summary, pointer=where, hint=hint))
    return out


def _told(units: set[str | None]) -> str:
    return listed(sorted(unit for unit in units if unit is not None))


def _quantity(unit: str | None) -> str:
    """One unit for all of a quantity."""
    return {"degF": "degC", "K": "degC", "hPa": "kPa"}.get(unit or "", unit or "")


def _units_in(schema: Any) -> Iterator[str | None]:
    """The unit of each number in a result, None where it has none, and those that a member `unit` beside may say."""
    if isinstance(schema, list):
        for item in schema:
            yield from _units_in(item)
    elif isinstance(schema, dict):
        members = schema.get("properties")
        given = {name: item for name, item in members.items() if isinstance(item, dict)} if members else {}
        beside = given.get("unit", {})
        yield from (unit_of_text(word) for word in (beside.get("const"), *beside.get("enum", ())) if word is not None)
        for name, member in given.items():
            kinds = member.get("type")
            if "unit" not in given and {"number", "integer"} & {*(kinds if isinstance(kinds, list) else [kinds])}:
                yield unit_of_name(name) or unit_in(member.get("description"))
        for item in schema.values():
            yield from _units_in(item)


_SERIAL = regex(
    r"(?i)(?:^|_)serial(?:_?(?:number|no|nr|num|id))?$|(?:^|_)(?:imei|imsi|iccid|meid)$|^(?:system|product)_uuid$"
)


def serial_returned(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No result has a serial number: which unit it is is no reading, and it goes to every model that asks."""
    out = []
    for index, tool in enumerate(value["tools"]):
        for where, name, member in _members(tool.get("output_schema"), ("tools", index, "output_schema")):
            if _SERIAL.search(name) and "boolean" not in str(member.get("type")):
                summary = f"the result of {display(tool['name'])} has the serial number {display(name)}"
                hint = "take it out: maker and model state the kind, and a device is named by its id"
                out.append(error("INTERFACE-RESULT-SERIAL", summary, pointer=pointer(*where), hint=hint))
    return out


def _members(value: Any, where: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], str, JsonObject]]:
    """(place, name, schema) of every member of a result, at any depth."""
    if isinstance(value, dict):
        members = value.get("properties")
        for name, item in members.items() if isinstance(members, dict) else ():
            if isinstance(item, dict):
                yield (*where, "properties", name), name, item
        for name, item in value.items():
            yield from _members(item, (*where, name))
    elif isinstance(value, list):
        for index, item in enumerate(value):
            yield from _members(item, (*where, index))


RULES = (
    Rule("INTERFACE-RESULT-SERIAL", serial_returned),
    Rule("INTERFACE-CHANNEL-UNIT", channel_unit),
    Rule("INTERFACE-INPUT-SCHEMA", input_schema),
    Rule("INTERFACE-OUTPUT-SCHEMA", output_schema),
    Rule("INTERFACE-UNTYPED-PROPERTY", untyped_property),
    Rule("INTERFACE-REQUIRED-UNKNOWN", required_unknown),
    Rule("INTERFACE-DEVICE-PARAMETER", device_parameter),
    Rule("INTERFACE-LIMIT-MISSING", limit_missing),
    Rule("INTERFACE-LIMIT-WIDER", limit_wider),
    Rule("INTERFACE-LIMIT-EMPTY", limit_empty),
    Rule("INTERFACE-SMOKE", smoke_arguments),
)


def _invalid(value: JsonObject, member: str, code: str) -> list[Diagnostic]:
    out = []
    for index, tool in enumerate(value["tools"]):
        schema = tool.get(member)
        if schema is None:
            continue
        problem = _schema_problem(schema)
        if problem is not None:
            summary = f"the {member} of {display(tool['name'])} {problem}"
            hint = "write a JSON Schema (2020-12) of type object that refers to nothing outside itself"
            out.append(error(code, summary, pointer=pointer("tools", index, member), hint=hint))
    return out


def _schema_problem(schema: JsonObject) -> str | None:
    if schema.get("type") != "object":
        return f"has the type {display(schema.get('type', 'none'))}, not object"
    if (problem := _misshapen(json.dumps(schema))) is not None:
        return problem
    try:
        size = _unfolded(schema, schema, {})
    except _Unusable as problem:
        return str(problem)
    return None if size <= MAX_UNFOLDED else f"unfolds to more than {MAX_UNFOLDED} parts"


@lru_cache(maxsize=512)
def _misshapen(schema: str) -> str | None:
    """Why a string is no JSON Schema. Remembered: a contract is checked several times in a run, and tools are alike."""
    try:
        Draft202012Validator.check_schema(parse(schema))
    except SchemaError as problem:
        place = "/".join(str(part) for part in problem.absolute_path) or "its top"
        return f"is not a valid schema at {display(place)}: its {display(problem.validator)} is wrong"
    return None


class _Unusable(Exception):
    """A reference that leads nowhere, or back to itself."""


def _unfolded(place: Any, root: JsonObject, sizes: dict[str, int]) -> int:
    """How many parts a schema has once every reference in it is written out.

    Twenty small definitions that each name the next one twice unfold to a million parts; validating against them
    would never end. ``sizes`` remembers each reference, 0 while it is being counted.
    """
    if isinstance(place, list):
        return 1 + sum(_unfolded(item, root, sizes) for item in place)
    if not isinstance(place, dict):
        return 1
    size = 1
    for name in ("$ref", "$dynamicRef"):
        reference = place.get(name)
        if isinstance(reference, str):
            if reference not in sizes:
                sizes[reference] = 0
                sizes[reference] = _unfolded(_target(reference, root), root, sizes)
            if sizes[reference] == 0:
                raise _Unusable(f"refers to itself by {display(reference)}")
            size += sizes[reference]
    return size + sum(_unfolded(item, root, sizes) for name, item in place.items() if name != "$defs")


def _target(reference: str, root: JsonObject) -> Any:
    known = reference == "#" or reference.startswith("#/")
    place = resolve(root, reference) if known else None
    if not known or not isinstance(place, dict | bool):
        raise _Unusable(f"refers to {display(reference)}, which is not in it")
    return place


def _properties(tool: JsonObject) -> dict[str, Any]:
    properties = tool["input_schema"].get("properties")
    return properties if isinstance(properties, dict) else {}


def _required(tool: JsonObject) -> list[Any]:
    required = tool["input_schema"].get("required")
    return required if isinstance(required, list) else []


def _choices(member: Any, tool: JsonObject) -> set[str]:
    """The values that a ``device`` parameter may take; an unbounded string of a one-device tool counts as it."""
    if not isinstance(member, dict):
        return set()
    found: set[str] = set()
    for part in (member, *member.get("anyOf", ()), *member.get("oneOf", ())):
        if isinstance(part, dict):
            found.update(str(item) for item in part.get("enum", ()) if item is not None)
            found.update([str(part["const"])] if "const" in part else [])
    return found or (set(tool["devices"]) if len(tool["devices"]) == 1 else set())


def _profile_limits(
    value: JsonObject, artifacts: Artifacts
) -> Iterator[tuple[int, JsonObject, Mapping[str, Any], str]]:
    """(tool index, tool, limit, profile) of each range that is in force for a tool; all else the endpoint keeps."""
    used = {
        (device["profile"], device["id"]) for device in (artifacts.identify or {})["devices"] if "profile" in device
    }
    for index, tool in enumerate(value["tools"]):
        for name, facts in artifacts.profiles.items():
            if not any((name, device) in used for device in tool["devices"]):
                continue
            for limit in facts.limits:
                if ("minimum" in limit or "maximum" in limit) and _concerns(limit, tool):
                    yield index, tool, limit, name


def _concerns(limit: Mapping[str, Any], tool: JsonObject) -> bool:
    """A tool that is named in full must have the parameter, too; one behind a glob is concerned where it has it."""
    names, wanted = (tool["name"], tool["capability"]), limit.get("tool")
    if wanted in names:
        return True
    is_meant = wanted is None or any(fnmatchcase(name, wanted) for name in names)
    return is_meant and limit["parameter"] in _properties(tool)


def _limit_of(tool: JsonObject, parameter: str) -> JsonObject | None:
    return next((item for item in tool.get("limits", ()) if item["parameter"] == parameter), None)


def _within(has: Mapping[str, Any], wanted: Mapping[str, Any]) -> bool:
    if "minimum" in wanted and has.get("minimum", float("-inf")) < wanted["minimum"]:
        return False
    if "maximum" in wanted and has.get("maximum", float("inf")) > wanted["maximum"]:
        return False
    return not wanted.get("unit") or has.get("unit") == wanted["unit"]


def _range(limit: Mapping[str, Any]) -> str:
    low, high = limit.get("minimum", "-"), limit.get("maximum", "-")
    unit = limit.get("unit")
    return f"{display(limit['parameter'])} {low} to {high}" + (f" {display(unit)[1:-1]}" if unit else "")


def _misfit(arguments: JsonObject, schema: JsonObject) -> str | None:
    """Why the arguments do not fit, in one line; None when they do. Patterns are not run."""
    if _schema_problem(schema) is not None:
        return None
    problem = best_match(validator(_without_patterns(schema)).iter_errors(arguments))
    return _reason(problem) if problem is not None else None


def _reason(problem: Problem) -> str:
    place = "/".join(str(part) for part in problem.absolute_path) or "the arguments"
    if problem.validator == "required":
        absent = [name for name in problem.validator_value if name not in problem.instance]
        return f"{display(place)[1:-1]} lack {', '.join(display(name) for name in absent)}"
    return f"{display(place)[1:-1]}: {display(problem.instance, 40)} breaks {display(problem.validator)}"


def _without_patterns(schema: Any) -> Any:
    if isinstance(schema, dict):
        return {
            name: item if name in ("const", "enum", "default") else _without_patterns(item)
            for name, item in schema.items()
            if not (name in _RUNS_A_PATTERN and not _is_property_table(item, name))
        }
    if isinstance(schema, list):
        return [_without_patterns(item) for item in schema]
    return schema


def _is_property_table(item: Any, name: str) -> bool:
    """True for a parameter that is called like a keyword (``format``): then the value is its schema."""
    return name in ("pattern", "format") and isinstance(item, dict)
