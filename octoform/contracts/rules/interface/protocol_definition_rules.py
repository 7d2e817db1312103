"""Rules for a device whose owner described how it is driven: it has the tools and the bounds of the description.

A protocol definition is closed. A tool beside it would send something that no one described, and one with other
parameters would let a caller say what the description does not allow; both come from an agent that guesses. An answer
is one sentence; the bounds of what acts by it are its numbers, since a range from memory may be another product's.
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, described, does_stop
from octoform.contracts.movement_words import spoken, unknown_units, within_answer
from octoform.contracts.rules.interface.bound_rules import parameters_of
from octoform.contracts.rules.interface.interface_rules import SPARED
from octoform.contracts.rules.raw_line_rules import lines_answered, lines_answered_incompletely
from octoform.diagnostics import Diagnostic, did_you_mean, error

CODE, UNFOUNDED = "INTERFACE-GRAMMAR-DIFFERS", "INTERFACE-RANGE-UNFOUNDED"
_WAITS = frozenset({"timeout", "wait"})
"""Words of a parameter that bounds the call and not the device."""


def definition_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The tools of a device with a protocol definition mirror it exactly: names, effects, and what a caller may say."""
    spared = {item["id"] for item in value["left_out"] if item["reason"] in SPARED}
    out: list[Diagnostic] = []
    for device, profile, commands in described(artifacts.identify, artifacts):
        tools = {tool["capability"]: (at, tool) for at, tool in enumerate(value["tools"]) if device in tool["devices"]}
        absent = [name for name in commands if name not in tools]
        if absent and device not in spared:
            summary = (
                f"{display(device)} lacks {listed(absent)}, which the protocol definition of {display(profile)} has"
            )
            hint = "make one tool of that name for each command of the protocol definition"
            out.append(error(CODE, summary, pointer="/tools", hint=hint))
        for name, (at, tool) in tools.items():
            problem = _problem(name, tool, commands)
            if problem is not None:
                summary = f"the tool {display(tool['name'])} of {display(device)} {problem[0]} of {display(profile)}"
                out.append(error(CODE, summary, pointer=pointer("tools", at), hint=problem[1]))
    return out


def range_unfounded(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The bounds of what acts through a raw line by an answer are numbers of the answer, or narrower."""
    answered = lines_answered(artifacts.identify, artifacts)
    incomplete = lines_answered_incompletely(artifacts.identify, artifacts)
    out = []
    for index, tool in enumerate(value["tools"]):
        sources = {
            device: answered[device] for device in tool["devices"] if device in answered and device not in incomplete
        }
        for name, where, member in parameters_of(index, tool) if tool["effect"] != "read" else ():
            waits = _WAITS.intersection(spoken(name))
            for device, answer in sources.items() if not waits else ():
                strange = [number for number in _numbers(member) if not within_answer(number, answer)]
                if strange:
                    summary = f"{display(name)} of {display(tool['name'])} reaches {strange[0]:g}, which the owner's "
                    summary += f"answer about {display(device)} does not allow: {display(answer)}"
                    hint = "write the numbers of the answer, in its units, or narrower ones; for its owner alone: "
                    hint += f'`octoform answer {device} "..."` records another range, `octoform profile new {device}` '
                    out.append(error(UNFOUNDED, summary, pointer=where, hint=f"{hint}drafts a profile"))
                    break
    return out


def _numbers(member: Mapping[str, Any]) -> list[float]:
    """The numbers by which a parameter is bounded: its ends, or each that it may be."""
    ends = [member.get(side) for side in ("minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum", "const")]
    words = member.get("enum")
    given = [*ends, *(words if isinstance(words, list) else ())]
    return [float(each) for each in given if isinstance(each, int | float) and not isinstance(each, bool)]


RULES = (Rule(CODE, definition_differs), Rule(UNFOUNDED, range_unfounded))


def _problem(name: str, tool: JsonObject, commands: Mapping[str, Mapping[str, Any]]) -> tuple[str, str] | None:
    """The difference of a tool from its command, and what to do."""
    command = commands.get(name)
    if command is None or tool["name"] != name:
        near = did_you_mean(tool["name"], list(commands))
        hint = f"did you mean {near}?" if near else f"its commands are {listed(list(commands))}"
        return "is no command of the protocol definition", hint
    if tool["effect"] != command["effect"]:
        return f"is {tool['effect']}, unlike the command", f"write {command['effect']}"
    if does_stop(command) is not bool(tool.get("stops", False)):
        word = "true" if does_stop(command) else "false"
        return f"is {'no' if word == 'true' else 'a'} tool that stops, unlike the command", f'write "stops": {word}'
    return _parameters(tool["input_schema"], command.get("parameters", {}))


def _parameters(schema: JsonObject, wanted: Mapping[str, Mapping[str, Any]]) -> tuple[str, str] | None:
    """Each parameter has its type and its words, and may be omitted where the command has a default, only there."""
    given = schema.get("properties") or {}
    has = {name: member for name, member in given.items() if name != "device" and isinstance(member, dict)}
    if {name: member.get("type") for name, member in has.items()} != {
        name: parameter["type"] for name, parameter in wanted.items()
    }:
        text = ", ".join(f"{name}: {parameter['type']}" for name, parameter in wanted.items()) or "none"
        return "has other parameters than the command", f"its parameters beside `device` are {text}"
    required = schema.get("required")
    for name, parameter in wanted.items():
        if strange := unknown_units(str(has[name].get("description", "")), str(parameter)):
            return (
                f"has {display(name)} in {strange[0]}, unlike the command",
                f"its unit is {parameter.get('unit', 'none')}",
            )
    needed = set(required) if isinstance(required, list) else set()
    for name, parameter in wanted.items():
        default = parameter.get("default")
        if (name in needed) is not (default is None):
            does, must = ("lets a caller leave out", "is") if default is None else ("requires", "is not")
            return f"{does} {display(name)}, unlike the command", f"it {must} required"
        if default is not None and has[name].get("default") != default:
            return f"has another default of {display(name)} than the command", f'write "default": {default}'
        words = _words(has[name])
        if "enum" in parameter and not (words and words <= set(parameter["enum"])):
            return f"takes other words for {display(name)} than the command", f"they are {listed(parameter['enum'])}"
    return None


def _words(member: Mapping[str, Any]) -> set[str]:
    """The words that a parameter takes; none where it takes any text."""
    words = member.get("enum", [member["const"]] if "const" in member else [])
    return {word for word in words if isinstance(word, str)} if isinstance(words, list) else set()
