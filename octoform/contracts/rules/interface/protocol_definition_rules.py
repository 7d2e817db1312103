"""The rule for a device whose owner described its whole protocol definition: one tool for each command, and no other.

A description is closed. A tool beside it would send something that no one described, and one with other parameters
would let a caller say what the description does not allow; both come from an agent that guesses.
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.pointer import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule, described, does_stop
from octoform.contracts.rules.interface.interface_rules import SPARED
from octoform.diagnostics import Diagnostic, did_you_mean, error

CODE = "INTERFACE-GRAMMAR-DIFFERS"


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


RULES = (Rule(CODE, definition_differs),)


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
