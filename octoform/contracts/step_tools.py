"""The tools of a device as a privileged step may use them: which moves it, which reads it, which units they name."""

from collections.abc import Iterator, Mapping
from typing import Any

from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.naming import same_action

_CAPTURE = same_action("capture_image")
_DEVICE = "device"
_NUMBERS = ("number", "integer")
_SWITCH = ("boolean",)


def tool(artifacts: Artifacts, name: str) -> JsonObject | None:
    """The tool of INTERFACE with that name."""
    return next((item for item in _tools(artifacts) if item["name"] == name), None)


def tools_of(artifacts: Artifacts, device: str | None) -> list[JsonObject]:
    """The tools that serve a device."""
    return [item for item in _tools(artifacts) if device in item["devices"]]


def _tools(artifacts: Artifacts) -> list[JsonObject]:
    return list(artifacts.interface["tools"]) if artifacts.interface is not None else []


def takes_pictures(item: JsonObject) -> bool:
    """True for a tool that reads what a camera sees."""
    names = (str(item["capability"]), str(item["name"]))
    return item["effect"] == "read" and any(same_action(name) >= _CAPTURE for name in names)


def properties(item: JsonObject) -> Mapping[str, Any]:
    """The parameters of a tool with their schemas."""
    found = item["input_schema"].get("properties")
    return found if isinstance(found, dict) else {}


def is_numeric(item: JsonObject, parameter: str) -> bool:
    """True for a parameter of a tool that takes numbers and nothing else."""
    return _is_of(item, parameter, _NUMBERS)


def is_switch(item: JsonObject, parameter: str) -> bool:
    """True for a parameter of a tool that takes true and false and nothing else."""
    return _is_of(item, parameter, _SWITCH)


def _is_of(item: JsonObject, parameter: str, allowed: tuple[str, ...]) -> bool:
    schema = properties(item).get(parameter)
    kinds = schema.get("type") if isinstance(schema, dict) else None
    return all(kind in allowed for kind in kinds) and bool(kinds) if isinstance(kinds, list) else kinds in allowed


def units(artifacts: Artifacts, device: str | None) -> dict[str, tuple[str, ...]]:
    """Parameters that name a unit of the device, with the names: a moving and a reading tool offer the same choice."""
    served = tools_of(artifacts, device)
    moved = dict(choice for item in served if item["effect"] == "actuate" for choice in _choices(item))
    read = [choice for item in served if item["effect"] == "read" for choice in _choices(item)]
    return {name: names for name, names in read if moved.get(name) == names}


def _choices(item: JsonObject) -> Iterator[tuple[str, tuple[str, ...]]]:
    for name, schema in properties(item).items():
        names = schema.get("enum") if isinstance(schema, dict) and name != _DEVICE else None
        if isinstance(names, list) and names and all(isinstance(one, str) for one in names):
            yield name, tuple(sorted(one for one in names if not one.isdigit()))  # an id is another name for a unit
