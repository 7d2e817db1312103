"""The trial calls of a read tool, one for each device, with harmless arguments: its author's or its schema's."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

_SIMPLE: dict[str, Any] = {"boolean": False, "array": [], "object": {}, "null": None}


@dataclass(frozen=True, slots=True)
class Trial:
    """A call to make. ``device`` is None where the tool does not say which; ``arguments`` where none are harmless."""

    tool: str
    device: str | None
    arguments: dict[str, Any] | None


def trials(tool: Mapping[str, Any]) -> list[Trial]:
    """The calls that prove a tool of the INTERFACE artifact: one for each value of its parameter ``device``."""
    name, given = tool["name"], trial_arguments(tool)
    listed = tool["input_schema"].get("properties", {}).get("device", {}).get("enum", ())
    devices = [value for value in listed if isinstance(value, str)]
    if given is not None and len(devices) > 1:
        return [Trial(name, device, {**given, "device": device}) for device in devices]
    only = tool.get("devices") or (None,)
    return [Trial(name, only[0] if len(only) == 1 else None, given)]


def trial_arguments(tool: Mapping[str, Any]) -> dict[str, Any] | None:
    """Arguments for a tool of the INTERFACE artifact; None when a required one cannot be derived.

    The author's ``smoke.arguments`` come first. Otherwise only required parameters are given a value: the schema's
    default, constant, first example or choice, or its lower bound.
    """
    smoke = tool.get("smoke")
    if isinstance(smoke, Mapping):
        return dict(smoke.get("arguments", {}))
    schema = tool["input_schema"]
    properties = schema.get("properties", {})
    found = {}
    for name in schema.get("required", []):
        known, value = _value(properties.get(name, {}))
        if not known:
            return None
        found[name] = value
    return found


def _value(schema: Mapping[str, Any]) -> tuple[bool, Any]:
    for key in ("default", "const"):
        if key in schema:
            return True, schema[key]
    for key in ("enum", "examples"):
        if schema.get(key):
            return True, schema[key][0]
    return _by_type(schema)


def _by_type(schema: Mapping[str, Any]) -> tuple[bool, Any]:
    kind = schema.get("type")
    if kind in ("integer", "number"):
        return _number(schema, whole=kind == "integer")
    if kind == "array" and schema.get("minItems", 0) > 0:
        known, item = _value(schema.get("items", {}))
        return known, [item] * schema["minItems"]
    if kind == "object" and schema.get("required"):
        return False, None
    return (kind in _SIMPLE, _SIMPLE.get(str(kind)))


def _number(schema: Mapping[str, Any], *, whole: bool) -> tuple[bool, Any]:
    if "minimum" in schema:
        return True, schema["minimum"]
    if "exclusiveMinimum" in schema:
        low = schema["exclusiveMinimum"]
        return True, low + 1 if whole else low + 1e-6
    # A number without a lower bound has no value that is known to be harmless, except a bound from above.
    return ("maximum" in schema, schema.get("maximum"))
