"""The tools of a command grammar: exactly one for each command, with its name, its effect and its parameters.

Bounds are those of the grammar, narrowed by the limits of its profile, and stand in the schema as well as in the
tool's limits, so that a client sees what the endpoint enforces.
"""

import re
from collections.abc import Mapping
from typing import Any

from octoform.builtin.grammars import Profiles, commands, parameters
from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, Schema, one_of, record
from octoform.builtin.task import Refused

WORTH = 95
"""What a person described is wanted before anything that was merely found."""
DONE = record("LineDone", device=TEXT, command=TEXT, answer=TEXT)
_WORD = re.compile(r"[^\s,;:()]+")
_TYPES = {"integer": WHOLE, "number": NUMBER, "string": TEXT}


def kinds(profiles: Profiles, taken: Mapping[str, Kind]) -> dict[str, Kind]:
    """A kind of tool for each command of each grammar; Refused for a name that the catalog has already."""
    found = {}
    for name, (profile, command) in commands(profiles).items():
        if name in taken:
            raise Refused(
                f"the profile {profile['name']} names a tool {name}, which is this agent's own; rename it there"
            )
        found[name] = _kind(profile, command)
    return found


def answer(command: Mapping[str, Any]) -> Schema:
    """The result of a command: its typed fields, or what was said and answered."""
    fields = command.get("fields") or {}
    if not fields:
        return DONE
    title = "".join(word.capitalize() for word in str(command["tool"]).split("_")) + "Answer"
    return record(title, device=TEXT, **{name: _TYPES[value["type"]] for name, value in fields.items()})


def _kind(profile: Mapping[str, Any], command: Mapping[str, Any]) -> Kind:
    values = parameters(profile, command)
    is_read = command["effect"] == "read"
    return Kind(
        name=str(command["tool"]),
        description=_description(profile, command),
        output=answer(command),
        worth=WORTH,
        effect=str(command["effect"]),
        parameters=lambda _: {name: _schema(name, value) for name, value in values.items()},
        smoke={name: _any_of(value) for name, value in values.items()} if is_read else {},
        units={name: str(value["unit"]) for name, value in values.items() if value.get("unit")},
        idempotent=is_read,
    )


def _description(profile: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    about = str(command["about"]).strip()
    sentence = about[:1].upper() + about[1:] + ("" if about.endswith((".", "!", "?")) else ".")
    units = [f"{name} in {value['unit']}" for name, value in (command.get("fields") or {}).items() if value.get("unit")]
    told = f" Returns {', '.join(units)}." if units else ""
    return f"{sentence}{told} By the line protocol of the profile {profile['name']}."


def _schema(name: str, value: Mapping[str, Any]) -> Schema:
    about = str(value.get("about") or name)
    described = about + _unit(value, about)
    if value["type"] == "string":
        return one_of(described, [str(word) for word in value["enum"]])
    bounds = {bound: value[bound] for bound in ("minimum", "maximum") if bound in value}
    return {"description": described, **_TYPES[value["type"]], **bounds}


def _unit(value: Mapping[str, Any], described: str) -> str:
    """The unit in brackets, unless the words say it anyway."""
    unit = str(value.get("unit") or "")
    return f" ({unit})" if unit and unit not in _WORD.findall(described) else ""


def _any_of(value: Mapping[str, Any]) -> Any:
    """A value that the parameter takes, for a trial call of a read."""
    return value["enum"][0] if "enum" in value else value.get("minimum", 0)
