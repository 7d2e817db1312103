"""A tool's arguments by its schema, and the text of its result: for a person's call and for DEPLOY's check alike.

One of the files that run in the serving environment too, so it imports nothing of octoform. The validator takes longer
to load than a call takes, so it is loaded only where there is something to judge.
"""

import json
from collections.abc import Mapping
from typing import Any

MAX_LENGTH = 1000


def as_tool(wire: Mapping[str, Any]) -> dict[str, Any]:
    """A tool of tools/list under the names that octoform's documents use."""
    return {
        "name": wire["name"],
        "description": wire.get("description", ""),
        "input_schema": wire["inputSchema"],
        "output_schema": wire.get("outputSchema"),
        "annotations": wire.get("annotations"),
    }


def result_text(wire: Mapping[str, Any]) -> str:
    """The texts of a result, bounded."""
    content = wire.get("content", [])
    return "\n".join(item.get("text", "") for item in content if item.get("type") == "text")[:MAX_LENGTH]


def converted(texts: Mapping[str, str], schema: Mapping[str, Any]) -> dict[str, Any]:
    """Texts from a command line as the values that the schema wants; what does not convert stays text."""
    properties = schema.get("properties", {})
    return {name: _convert(text, properties.get(name, {})) for name, text in texts.items()}


def _convert(text: str, schema: Mapping[str, Any]) -> Any:
    """``text`` itself where the schema takes it, else its value as JSON where there is one."""
    import jsonschema

    if schema and jsonschema.Draft202012Validator(schema).is_valid(text):
        return text
    try:
        return json.loads(text)
    except ValueError:
        return text


def first_fault(arguments: Mapping[str, Any], schema: Mapping[str, Any]) -> dict[str, Any] | None:
    """Field and message of the first argument that breaks the input schema."""
    if not arguments and not schema.get("required"):
        return None
    import jsonschema

    problem = jsonschema.exceptions.best_match(jsonschema.Draft202012Validator(schema).iter_errors(arguments))
    if problem is None:
        return None
    field = str(problem.absolute_path[0]) if problem.absolute_path else None
    if problem.validator == "required":
        field = next((name for name in problem.validator_value if name not in arguments), None)
    elif problem.validator == "additionalProperties":
        field = next((name for name in arguments if name not in schema.get("properties", {})), None)
    return {"field": field, "message": problem.message[:500]}
