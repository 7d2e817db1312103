"""The rule for a device whose owner described its whole command grammar: one tool for each command, and no other.

A description is closed. A tool beside it would send something that nobody described, and one with other parameters
would let a caller say what the description does not allow; both come from an agent that guesses.
"""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import Diagnostic, did_you_mean, error

CODE = "INTERFACE-GRAMMAR-DIFFERS"


def grammar_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The tools of a device with a grammar mirror it exactly: names, effects, parameters and their types."""
    spared = {item["id"] for item in value["left_out"] if item["reason"] == "tool_budget"}
    out: list[Diagnostic] = []
    for device, profile, commands in _described(artifacts):
        tools = {tool["capability"]: (at, tool) for at, tool in enumerate(value["tools"]) if device in tool["devices"]}
        absent = [name for name in commands if name not in tools]
        if absent and device not in spared:
            summary = f"{shown(device)} lacks {listed(absent)}, which the grammar of {shown(profile)} has"
            hint = "make one tool of that name for each command of the grammar"
            out.append(error(CODE, summary, pointer="/tools", hint=hint))
        for name, (at, tool) in tools.items():
            problem = _problem(name, tool, commands)
            if problem is not None:
                summary = f"the tool {shown(tool['name'])} of {shown(device)} {problem[0]} of {shown(profile)}"
                out.append(error(CODE, summary, pointer=pointer("tools", at), hint=problem[1]))
    return out


RULES = (Rule(CODE, grammar_differs),)


def _described(artifacts: Artifacts) -> Iterator[tuple[str, str, Mapping[str, Mapping[str, Any]]]]:
    """(device, profile, commands by tool) of each device that a profile with a grammar identified."""
    for device in (artifacts.identify or {"devices": []})["devices"]:
        facts = artifacts.profiles.get(device.get("profile", ""))
        if facts is not None and facts.commands:
            yield device["id"], facts.name, {command["tool"]: command for command in facts.commands}


def _problem(name: str, tool: JsonObject, commands: Mapping[str, Mapping[str, Any]]) -> tuple[str, str] | None:
    """What of a tool is not as its command says, and what to do."""
    command = commands.get(name)
    if command is None or tool["name"] != name:
        near = did_you_mean(tool["name"], list(commands))
        hint = f"did you mean {near}?" if near else f"its commands are {listed(list(commands))}"
        return "is no command in the grammar", hint
    if tool["effect"] != command["effect"]:
        return f"is {tool['effect']}, unlike the command", f"write {command['effect']}"
    properties = tool["input_schema"].get("properties") or {}
    has = {
        key: schema.get("type") for key, schema in properties.items() if key != "device" and isinstance(schema, dict)
    }
    wanted = {key: parameter["type"] for key, parameter in command.get("parameters", {}).items()}
    if has == wanted:
        return None
    told = ", ".join(f"{key}: {kind}" for key, kind in wanted.items()) or "none"
    return "has other parameters than the command", f"its parameters beside `device` are {told}"
