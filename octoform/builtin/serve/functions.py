"""The heads of the server's functions, written from the artifact: typed parameters, documentation, registration.

Ranges, defaults and choices are the artifact's own, so what a profile narrowed there is narrow here.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from octoform.builtin.serve.shapes import WIDTH, Shapes, quoted

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
