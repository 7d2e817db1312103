"""The live endpoint for a person and for a program: its tools, an answer."""

import json
from typing import Any

from octoform.engine.tools import Answer
from octoform.escaping import escaped_json
from octoform.views.format.console import Console
from octoform.views.format.values import escape, one_line

_LONGEST = 20_000
"""Characters of a foreign text: enough for every description, and no flood."""


def tools(console: Console, listed: list[dict[str, Any]], *, as_json: bool) -> int:
    """Name, effect, description and parameters of each tool; wrapped on a terminal, whole in a pipe."""
    if as_json:
        _json(console, {"format": 1, "tools": listed})
        return 0
    if not listed:
        console.line("The endpoint has no tools: nothing here can be controlled or read through a standard interface.")
    for tool in listed:
        effect = tool.get("effect") or "?"
        colour = "green" if effect == "read" else "yellow"
        console.line(f"{console.paint(tool['name'], 'bold')}  {console.paint(effect, colour)}")
        console.wrapped("    ", one_line(tool.get("description") or "", _LONGEST), indent=4)
        for line in _parameters(tool["input_schema"]):
            console.wrapped("      ", line, indent=8)
    return 0


def _parameters(schema: dict[str, Any]) -> list[str]:
    required = set(schema.get("required", []))
    lines = []
    for name, given in schema.get("properties", {}).items():
        kind = " | ".join(str(value) for value in given["enum"]) if "enum" in given else _kind(given)
        low, high = given.get("minimum"), given.get("maximum")
        span = f" {'' if low is None else low}..{'' if high is None else high}" if (low, high) != (None, None) else ""
        default = "" if "default" not in given else f", default {json.dumps(given['default'])}"
        need = "required, " if name in required else ""
        lines.append(one_line(f"{name}: {need}{kind}{span}{default}", _LONGEST))
    return lines


def _kind(given: dict[str, Any]) -> str:
    if "anyOf" in given:
        return " or ".join(_kind(item) for item in given["anyOf"])
    return str(given.get("const", given.get("type", "any")))


def answer(console: Console, tool: str, found: Answer, *, as_json: bool) -> int:
    """What the tool said; exit code 1 when it said that it failed."""
    result = found.result
    failed = 1 if result.is_error else 0
    if as_json:
        content = [block for block in result.content if block.get("type") == "text"]
        document = {
            "format": 1,
            "tool": tool,
            "is_error": result.is_error,
            "structured": result.structured,
            "content": content,
            "files": [str(path) for path in found.files],
            "ms": result.ms,
        }
        _json(console, document)
        return failed
    if result.is_error:
        console.problem(f"{tool}: {escape(result.message)}")
        return failed
    if result.structured is not None:
        console.raw(escape(json.dumps(result.structured, ensure_ascii=False, indent=2)))
    else:
        for block in result.content:
            if block.get("type") == "text":
                console.raw(escape(block.get("text", "")))
    for path in found.files:
        console.line(f"saved {path}")
    return failed


def _json(console: Console, value: dict[str, Any]) -> None:
    console.raw(escaped_json(json.dumps(value, ensure_ascii=False, indent=2)))
