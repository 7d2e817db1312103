"""The tools of a product's grammar: exactly one for each command, with its name, its effect and its parameters.

Bounds are those of the grammar, narrowed by the limits of its profile, and stand in the schema as well as in the
tool's limits, so that a client sees what the endpoint enforces.
"""

import re
from collections.abc import Mapping
from typing import Any

from octoform.builtin.grammars import Profiles, commands, parameters
from octoform.builtin.interface import answers, units
from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, Schema, one_of
from octoform.builtin.task import Refused

WORTH = 95
"""What a person described is wanted before anything that was merely found."""
_WORD = re.compile(r"[^\s,;:()]+")
_IDEMPOTENT = ("stop", "set_torque", "pose", "move_unit", "move_units")
"""What comes to the same when it is done once more: these name a goal, and no way from where the device is."""
_TYPES = {"integer": WHOLE, "number": NUMBER, "string": TEXT, "boolean": FLAG}


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


def _kind(profile: Mapping[str, Any], command: Mapping[str, Any]) -> Kind:
    values = parameters(profile, command)
    is_read = command["effect"] == "read"
    bank = profile["grammar"].get("registers")
    off = bank["disabled"] if bank else ()
    trial = {name: _any_of(value, off) for name, value in values.items() if "default" not in value}
    return Kind(
        name=str(command["tool"]),
        description=_description(profile, command),
        output=answers.of_units(bank, command) if bank else answers.of_line(profile["grammar"], command),
        worth=WORTH + (bank is not None and command["do"] == "stop"),  # nothing that moves is kept without its stop
        effect=str(command["effect"]),
        parameters=lambda _: {name: _schema(name, value) for name, value in values.items()},
        smoke=trial if is_read else {},
        units={name: str(value["unit"]) for name, value in values.items() if value.get("unit")},
        idempotent=is_read or command.get("do") in _IDEMPOTENT,
        stops=command.get("do") == "stop",
        acts_on=units.acted_on(profile["grammar"], command),
    )


def _description(profile: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    about = str(command["about"]).strip()
    sentence = about[:1].upper() + about[1:] + ("" if about.endswith((".", "!", "?")) else ".")
    if bank := profile["grammar"].get("registers"):
        more = answers.of_motion(bank, command)
        return f"{sentence}{more} By the registers of the profile {profile['name']}."
    units = [f"{name} in {value['unit']}" for name, value in (command.get("fields") or {}).items() if value.get("unit")]
    told = f" Returns {', '.join(units)}." if units else ""
    if answers.is_unanswered(profile["grammar"], command):
        told += " The device acknowledges nothing: that it was sent is all that is known."
    if not command.get("send", "do" in command):
        told += f" Waits up to {profile['grammar']['line']['timeout']:g} s for the device to say it by itself."
    return f"{sentence}{told} By the line protocol of the profile {profile['name']}."


def _schema(name: str, value: Mapping[str, Any]) -> Schema:
    about = str(value.get("about") or name)
    described = about + _unit(value, about)
    default = {"default": value["default"]} if "default" in value else {}
    if value["type"] == "string":
        return {**one_of(described, [str(word) for word in value["enum"]]), **default}
    bounds = {bound: value[bound] for bound in ("minimum", "maximum") if bound in value}
    return {"description": described, **_TYPES[value["type"]], **bounds, **default}


def _unit(value: Mapping[str, Any], described: str) -> str:
    """The unit in brackets, unless the words say it anyway."""
    unit = str(value.get("unit") or "")
    return f" ({unit})" if unit and unit not in _WORD.findall(described) else ""


def _any_of(value: Mapping[str, Any], off: Mapping[str, str] | tuple[()]) -> Any:
    """A value that the parameter takes, for a trial call of a read; no unit that is ``off`` where there is another."""
    if value["type"] == "boolean":
        return False
    if "enum" in value:
        return next((word for word in value["enum"] if word not in off), value["enum"][0])
    return value.get("minimum", 0)
