"""The heads of the server's functions, written from the artifact: typed parameters, documentation, registration.

Ranges, defaults and choices are the artifact's own, so what a profile narrowed there is narrow here.
"""

import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

# The server's types, written from the artifact's schemas: shapes of results, and which devices a tool may be given.
#
# A tool's result is a TypedDict of the functional form, because that is one line for a shape: the table of all shapes
# fits on one screen. (pydantic needs the one of typing_extensions before Python 3.12.)

WIDTH = 120
MAX_INLINE = 60
_PLAIN = {"string": "str", "integer": "int", "number": "float", "boolean": "bool"}


class Shapes:
    """Names and definitions of the types that a set of tools needs, each defined once."""

    def __init__(self, tools: Sequence[Mapping[str, Any]]) -> None:
        """Collect them in the order of the tools."""
        self.lines: list[str] = []
        self._records: dict[str, Mapping[str, Any]] = {}
        self._devices: dict[tuple[tuple[str, ...], str], str] = {}
        for tool in tools:
            if "output_schema" in tool:
                self.type_of(tool["output_schema"])
        for tool in tools:
            self.device_type(tool)
            for name, schema in tool["input_schema"].get("properties", {}).items():
                if name != "device" and ("enum" in schema or "const" in schema):
                    self.choice_type(tool, name)

    def type_of(self, schema: Mapping[str, Any]) -> str:
        """The Python type of a schema, defining the records in it; TypeError for what is not understood."""
        if "anyOf" in schema:
            return " | ".join("None" if part == {"type": "null"} else self.type_of(part) for part in schema["anyOf"])
        kind = schema.get("type")
        if kind == "array":
            return f"list[{self.type_of(schema['items'])}]"
        if kind == "object" and "title" in schema:
            return self._record(schema)
        if kind not in _PLAIN:
            raise TypeError(f"no Python type for the schema {dict(schema)}")
        return _PLAIN[kind]

    def device_type(self, tool: Mapping[str, Any]) -> str:
        """The type of a tool's ``device`` parameter, shared by the tools that serve the same devices."""
        schema = tool["input_schema"].get("properties", {}).get("device")
        if schema is None:
            return ""
        key = (choices(schema), schema.get("description", ""))
        if key not in self._devices:
            name = self._free_name(key[0], tool["capability"])
            self._devices[key] = name
            described = [f"Field(description={quoted(key[1])})"] if key[1] else []
            self.lines += _definition(f"{name} = Annotated[", [_literal(key[0]), *described], "]")
        return self._devices[key]

    def choice_type(self, tool: Mapping[str, Any], parameter: str) -> str:
        """The type of a parameter that is one of some words: written out, or defined where they are many."""
        words = choices(tool["input_schema"]["properties"][parameter])
        plain = _literal(words)
        if len(plain) <= MAX_INLINE:
            return plain
        name = "".join(word.capitalize() for word in f"{tool['capability']}_{parameter}".split("_"))
        lines = _definition(f"{name} = Literal[", [quoted(word) for word in words], "]")
        if not set(lines) <= set(self.lines):
            self.lines += lines
        return name

    def _free_name(self, devices: Sequence[str], capability: str) -> str:
        """A name for these devices that no other type has: tools of one kind may serve different ones."""
        words = re.findall(r"[a-z0-9]+", devices[0] if len(devices) == 1 else capability.partition("_")[2])
        name = "".join(word.capitalize() for word in words) + "Device"
        name = name if name[:1].isalpha() else f"The{name}"
        taken = self._devices.values()
        return next(
            free
            for number in range(1, len(taken) + 2)
            if (free := f"{name}{number}" if number > 1 else name) not in taken
        )

    def _record(self, schema: Mapping[str, Any]) -> str:
        name = str(schema["title"])
        if not name.isidentifier():
            raise TypeError(f"{name!r} is no name of a class")
        members = [f'"{key}": {self.type_of(value)}' for key, value in schema["properties"].items()]
        if set(schema.get("required", ())) != schema["properties"].keys():
            raise TypeError(f"{name} has members that may be missing; make them null instead")
        shape = {key: value for key, value in schema.items() if key != "$comment"}
        if self._records.setdefault(name, shape) != shape:
            raise TypeError(f"two different records are called {name}")
        lines = _definition(f'{name} = TypedDict("{name}", {{', members, "})")
        if not set(lines) <= set(self.lines):
            self.lines += lines
        return name


def choices(schema: Mapping[str, Any]) -> tuple[str, ...]:
    """The words that a string parameter may be."""
    return tuple(schema["enum"]) if "enum" in schema else (schema["const"],)


def quoted(text: str) -> str:
    """A Python string literal in double quotes, of one line."""
    escaped = text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\r", "\\r")
    if escaped == text.replace('"', '\\"') and '"' in text and "'" not in text:
        return f"'{text}'"
    return f'"{escaped}"'


def _literal(words: Sequence[str]) -> str:
    return "Literal[" + ", ".join(quoted(word) for word in words) + "]"


def _definition(start: str, parts: Sequence[str], end: str) -> list[str]:
    """``start a, b end`` in filled lines: the table of types is to take as little of the file as it can."""
    pieces = [piece for part in parts for piece in _breakable(part)]
    lines, line = [], start
    for index, piece in enumerate(pieces):
        last = index == len(pieces) - 1
        text = piece + (end if last else ",")
        gap = "" if line == start else " "
        if len(line) + len(gap) + len(text) > WIDTH and line != start:
            lines.append(line)
            line, gap = "   ", " "
        line += gap + text
    return [*lines, line]


def _breakable(part: str) -> list[str]:
    """The pieces of a part between which a line may end."""
    return part.split(", ") if part.startswith("Literal[") else [part]


_HINTS = ("readOnlyHint", "destructiveHint", "idempotentHint", "openWorldHint")
_NAMES = {
    (True, False, True, False): "READ",
    (True, False, False, False): "OBSERVE",
    (False, False, True, False): "SET",
    (False, False, False, False): "ACT",
}
_BOUNDS = {
    "minimum": "ge",
    "maximum": "le",
    "exclusiveMinimum": "gt",
    "exclusiveMaximum": "lt",
    "multipleOf": "multiple_of",
    "minLength": "min_length",
    "maxLength": "max_length",
    "pattern": "pattern",
}
_TYPES = {"integer": "int", "number": "float", "boolean": "bool", "string": "str"}


def annotation_names(tools: Sequence[Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Name of a constant to the MCP annotations that it holds, for all that these tools need."""
    found: dict[str, dict[str, Any]] = {}
    for tool in tools:
        if tool["annotations"] not in found.values():
            hints = tuple(tool["annotations"][hint] for hint in _HINTS)
            plain = set(tool["annotations"]) == set(_HINTS)
            found[_NAMES[hints] if plain and hints in _NAMES else f"HINTS_{len(found) + 1}"] = dict(tool["annotations"])
    return found


def heading(tool: Mapping[str, Any], shapes: Shapes) -> str:
    """``def`` line and documentation of one tool."""
    returns = shapes.type_of(tool["output_schema"])
    returns = "ToolResult" if returns in WITH_CONTENT else returns
    return "\n".join([*_signature(tool["capability"], _parameters(tool, shapes), returns), *_documentation(tool)])


def registration(tool: Mapping[str, Any], shapes: Shapes, hints: Mapping[str, Mapping[str, Any]]) -> str:
    """The line that makes a function a tool: logged, under its name, with what it may do."""
    returns = shapes.type_of(tool["output_schema"])
    options = [f"annotations={next(name for name, value in hints.items() if value == tool['annotations'])}"]
    if tool["name"] != tool["capability"]:
        options.insert(0, f"name={quoted(tool['name'])}")
    if returns in WITH_CONTENT:
        options.append(f"output_schema=TypeAdapter({returns}).json_schema()")
    return f"mcp.tool(runtime.logged({tool['capability']}), {', '.join(options)})"


WITH_CONTENT = ("Picture", "Recording")
"""Results that are a picture or a sound with data beside it."""


def _parameters(tool: Mapping[str, Any], shapes: Shapes) -> list[str]:
    schema = tool["input_schema"]
    properties = schema.get("properties", {})
    ordered = sorted(properties, key=lambda name: name not in schema.get("required", ()))
    return [_parameter(name, tool, shapes) for name in ordered]


def _parameter(name: str, tool: Mapping[str, Any], shapes: Shapes) -> str:
    schema = tool["input_schema"]["properties"][name]
    default = f" = {_value(schema['default'])}" if "default" in schema else ""
    if name == "device":
        return f"{name}: {shapes.device_type(tool)}{default}"
    kind = shapes.choice_type(tool, name) if "enum" in schema or "const" in schema else _TYPES[schema["type"]]
    fields = [f"{word}={_value(schema[key])}" for key, word in _BOUNDS.items() if key in schema]
    fields += [f"description={quoted(schema['description'])}"] if "description" in schema else []
    return f"{name}: Annotated[{kind}, Field({', '.join(fields)})]{default}" if fields else f"{name}: {kind}{default}"


def _value(value: Any) -> str:
    return quoted(value) if isinstance(value, str) else repr(value)


def _signature(name: str, parameters: list[str], returns: str) -> list[str]:
    whole = f"def {name}({', '.join(parameters)}) -> {returns}:"
    if len(whole) <= WIDTH:
        return [whole]
    return [f"def {name}(", *(f"    {parameter}," for parameter in parameters), f") -> {returns}:"]


def _documentation(tool: Mapping[str, Any]) -> list[str]:
    """The description as a docstring that gives it back unchanged but for its line breaks."""
    text = tool["description"].replace("\\", "\\\\").replace('"""', '\\"\\"\\"')
    if len(text) <= WIDTH - 10 and "\n" not in text and not text.endswith('"'):
        return [f'    """{text}"""']
    lines = [
        line for part in text.split("\n") for line in textwrap.wrap(part, WIDTH - 8, break_on_hyphens=False) or [""]
    ]
    return [f'    """{lines[0]}', *(f"    {line}".rstrip() for line in lines[1:]), '    """']
