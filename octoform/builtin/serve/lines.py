"""The part of the server that speaks line protocols, written from the protocol definition of the profiles in the task.

Each line that the server can ever send is spelt out in its own code; a caller's values enter it as numbers, or as
words of a list that the types allow.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.builtin.serve.functions import Shapes, heading, quoted
from octoform.builtin.task import Profiles, TaskRefused
from octoform.builtin.task import commands as all_commands
from octoform.patterns import regex

Spoken = Mapping[str, tuple[Mapping[str, Any], Mapping[str, Any]]]
"""Tool name to (profile, command)."""
_PLACEHOLDER = regex(r"\{([a-z][a-z0-9_]*)\}")
_FORMATS = {"integer": ":d", "number": ":.6f", "string": ""}
_PATTERNS = {
    "integer": r"[+-]?\d{1,18}",
    "number": r"[+-]?(?:\d{1,18}(?:\.\d{0,18})?|\.\d{1,18})(?:[eE][+-]?\d{1,2})?",
    "string": r".{1,120}",
}
_CONVERTED = {
    "integer": 'int(found["{}"])',
    "number": 'float(found["{}"])',
    "string": 'found["{}"]',
    "boolean": 'found["{}"] == {}',
}


def commands(tools: Mapping[str, Mapping[str, Any]], profiles: Profiles) -> Spoken:
    """The commands that these tools (by capability) are for; TaskRefused where a tool has other parameters."""
    found = {name: pair for name, pair in all_commands(profiles).items() if name in tools}
    for name, (profile, command) in found.items():
        has = tools[name]["input_schema"].get("properties", {}).keys() - {"device"}
        if has != command.get("parameters", {}).keys():
            raise TaskRefused(
                f"the tool {name} has other parameters than the protocol definition of the profile {profile['name']}"
            )
    return found


def section(tools: Mapping[str, Mapping[str, Any]], spoken: Spoken, shapes: Shapes) -> dict[str, Any]:
    """The variables of the template."""
    profiles = {str(profile["name"]): profile for profile, _ in spoken.values()}
    return {
        "wires": {name: _wire(profile["grammar"]["line"]) for name, profile in profiles.items()},
        "functions": [
            {
                "head": heading(tools[name], shapes),
                "do": command.get("do", ""),
                "result": shapes.type_of(tools[name]["output_schema"]),
                **(_local_command(profile["grammar"], command) if "do" in command else _line_command(profile, command)),
            }
            for name, (profile, command) in spoken.items()
        ],
    }


def _line_command(profile: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """A command that goes over the line."""
    return {
        "wire": str(profile["name"]),
        "send": _send(command),
        "replies": f"[{', '.join(map(quoted, _replies(profile['grammar']['line'], command)))}]",
        "actuate": command["effect"] != "read",
        "fields": list(_fields(command)),
        "step": _step(profile["grammar"], str(command["tool"])),
    }


def _local_command(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """A tool that sends nothing to the device: what the server itself knows of it, or a stop."""
    if command["do"] == "stop":
        return {"until": quoted(str(grammar["stop"]["until"]))}
    if command["do"] != "position":
        raise TaskRefused(f"no template does {command['do']} for the tool {command['tool']}")
    axes = ", ".join(quoted(axis) for axis in grammar["position"]["axes"])
    kind, zero = quoted(grammar["line"]["class"]), quoted(str(grammar["position"]["zero"]))
    return {"kind": kind, "axes": f"[{axes}]", "zero": zero}


def _step(grammar: Mapping[str, Any], tool: str) -> str:
    """The effect of a command on the counted position and on a stop, as Python source; "" for none."""
    position = grammar.get("position") or {}
    given = [
        f"{quoted(axis)}, {of['parameter']}" for axis, of in position.get("axes", {}).items() if of["tool"] == tool
    ]
    given += ["zero=True"] if position.get("zero") == tool else []
    given += ["resumes=True"] if (grammar.get("stop") or {}).get("until") == tool else []
    return f"runtime.counting.Step({', '.join(given)})" if given else ""


def _wire(line: Mapping[str, Any]) -> dict[str, str]:
    """The arguments of the server's own type, as Python source."""
    error = _pattern(str(line["error"]), {"message": ".*"}) if "error" in line else ""
    numbers = {"baud": repr(line["baud"]), "timeout": repr(line["timeout"]), "settle": repr(line.get("settle", 0.0))}
    return {"kind": quoted(line["class"]), "ending": quoted(line["ending"]), "error": quoted(error), **numbers}


def _send(command: Mapping[str, Any]) -> str:
    """The line to send as Python source: a string, or an f-string of the parameters."""
    pattern, values = str(command.get("send", "")), command.get("parameters", {})
    if not values:
        return quoted(pattern)
    parts = _PLACEHOLDER.split(pattern)
    parts[::2] = [part.replace("\\", "\\\\").replace('"', '\\"') for part in parts[::2]]
    parts[1::2] = [_written(name, values[name]) for name in parts[1::2]]
    return f'f"{"".join(parts)}"'


def _written(name: str, value: Mapping[str, Any]) -> str:
    """A value of a caller inside of an f-string."""
    if value["type"] == "boolean":
        no, yes = value["words"]
        return f"{{'{yes}' if {name} else '{no}'}}"
    return f"{{{name}{_FORMATS[value['type']]}}}"


def _replies(line: Mapping[str, Any], command: Mapping[str, Any]) -> list[str]:
    """The pattern of each line of the answer; none where the product acknowledges nothing."""
    if "reply" not in command:
        return [re.escape(str(line["ok"]))] if "ok" in line else []
    values = {name: _one(value) for name, value in (command.get("fields") or {}).items()}
    reply = command["reply"]
    return [_pattern(str(text), values) for text in (reply if isinstance(reply, list) else [reply])]


def _one(value: Mapping[str, Any]) -> str:
    words = value.get("enum") or value.get("words")
    return "|".join(map(re.escape, words)) if words else _PATTERNS[value["type"]]


def _pattern(text: str, values: Mapping[str, str]) -> str:
    """A regular expression of a pattern with placeholders."""
    parts = _PLACEHOLDER.split(text)
    parts[::2] = [re.escape(part) for part in parts[::2]]
    parts[1::2] = [f"(?P<{name}>{values[name]})" for name in parts[1::2]]
    return "".join(parts)


def _fields(command: Mapping[str, Any]) -> Iterator[str]:
    for name, value in (command.get("fields") or {}).items():
        yield f"{name}={_CONVERTED[value['type']].format(name, quoted(value['words'][1]) if 'words' in value else '')}"
