"""The part of the server that drives units on register buses, written from the register maps of the profiles.

The server gets the map as a literal and a thin adapter over the library that the profile names; how units are read,
moved, protected and stopped is the runtime's. Each tool is one call of it, with what its command fixes spelt out.
"""

import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from octoform.builtin.serve.functions import Shapes, heading, quoted
from octoform.builtin.serve.lines import Spoken
from octoform.builtin.task import TaskRefused

_WIDTH = 110


def section(tools: Mapping[str, Mapping[str, Any]], spoken: Spoken, shapes: Shapes) -> dict[str, Any]:
    """The variables of the template."""
    profiles = {str(profile["name"]): profile for profile, _ in spoken.values()}
    return {
        "banks": [_bank(profile) for profile in profiles.values()],
        "functions": [
            {
                "head": heading(tools[name], shapes),
                "bank": slug(str(profile["name"])),
                "actuate": command["effect"] != "read",
                "given": list(_given(profile["grammar"]["registers"], command)),
                "call": _call(profile["grammar"]["registers"], command),
                "result": shapes.type_of(tools[name]["output_schema"]),
            }
            for name, (profile, command) in spoken.items()
        ],
    }


def libraries(spoken: Spoken) -> dict[str, str]:
    """Module to distribution of the libraries that these commands need."""
    banks = [profile["grammar"]["registers"] for profile, _ in spoken.values()]
    return {str(bank["library"]["module"]): str(bank["library"]["distribution"]) for bank in banks}


def slug(name: str) -> str:
    """The name of a profile as a part of a Python name."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")


def _bank(profile: Mapping[str, Any]) -> dict[str, Any]:
    bank = profile["grammar"]["registers"]
    module = str(bank["library"]["module"])
    if not module.isidentifier():
        raise TaskRefused(f"the profile {profile['name']} names a library {module!r}, which is no module")
    return {
        "name": slug(str(profile["name"])),
        "about": str(profile["name"]),
        "module": module,
        "protocol": repr(bank["library"]["protocol"]),
        "baud": repr(bank["baud"]),
        "kind": quoted(bank["class"]),
        "map": "\n".join(_map(bank)),
    }


def _map(bank: Mapping[str, Any]) -> Iterator[str]:
    """The members of the server's map as lines of Python source."""
    yield f"    unit={quoted(bank['unit'])},"
    yield from _table("units", ((name, repr(number)) for name, number in bank["units"].items()))
    yield from _table("disabled", ((name, quoted(why)) for name, why in bank["disabled"].items()))
    yield "    fields={"
    yield from (
        f"        {quoted(name)}: runtime.registers.Field({_field(of)})," for name, of in bank["fields"].items()
    )
    yield "    },"
    if motion := bank.get("motion"):
        yield "    motion=runtime.registers.Motion("
        yield from (f"        {key}={value}," for key, value in _motion(motion))
        yield "    ),"
    if protect := bank.get("protect"):
        given = [quoted(protect["field"]), repr(protect["refuse_at"]), repr(protect["resume_below"])]
        unit = [quoted(protect["unit"])] if protect.get("unit") else []
        yield f"    protect=runtime.registers.Protect({', '.join(given + unit)}),"
    if calibration := bank.get("calibration"):
        if calibration["format"] != "lerobot":
            raise TaskRefused(f"no template reads calibration files of the format {calibration['format']}")
        yield f"    calibration={_tuple(quoted(file) for file in calibration['files'])},"


def _table(name: str, items: Iterable[tuple[str, str]]) -> Iterator[str]:
    """A member that is a dictionary; nothing for an empty one."""
    if listed := [f"{quoted(key)}: {value}" for key, value in items]:
        yield from _filled(f"{name}={{", listed, "},")


def _field(field: Mapping[str, Any]) -> str:
    given = [repr(field["address"]), repr(field["bytes"])]
    given += [f"{key}={field[key]!r}" for key in ("scale", "sign_bit") if key in field]
    return ", ".join(given)


def _motion(motion: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for key in ("goal", "present", "lowest", "highest"):
        if key in motion:
            yield key, quoted(motion[key])
    for key in ("minimum", "maximum", "moved"):
        yield key, repr(motion[key])
    yield "within", repr(motion["timeout"])  # what the runtime calls it, to which accepted servers are written
    before = [pair for item in motion.get("before", ()) for pair in item.items()]
    yield "before", _tuple(f"({quoted(name)}, {_literal(value)})" for name, value in before)
    yield "release", _tuple(f"({quoted(name)}, {_literal(value)})" for name, value in motion.get("release", {}).items())
    if speed := motion.get("speed"):
        yield "speeds", f"({speed['minimum']!r}, {speed['maximum']!r})"


def _literal(value: Any) -> str:
    return quoted(value) if isinstance(value, str) else repr(value)


def _tuple(items: Iterable[str]) -> str:
    listed = list(items)
    return f"({', '.join(listed)}{',' if len(listed) == 1 else ''})"


def _given(bank: Mapping[str, Any], command: Mapping[str, Any]) -> Iterator[str]:
    """The fixed values of a command, as statements before its call."""
    if command["do"] in ("move_units", "pose"):
        fixed = bank["poses"][command["pose"]] if command["do"] == "pose" else {}
        moved = {name: name for name in command["parameters"] if name in bank["units"]}
        yield from _filled("goals = {", [f"{quoted(name)}: {of}" for name, of in (fixed or moved).items()], "}")
    elif command["do"] in ("read_unit", "read_units"):
        yield from _filled("fields = [", [quoted(field) for field in command["fields"]], "]")


def _filled(start: str, items: list[str], end: str) -> Iterator[str]:
    whole = f"{start}{', '.join(items)}{end}"
    if len(whole) <= _WIDTH:
        yield f"    {whole}"
    else:
        pieces = textwrap.wrap(", ".join(items) + ",", _WIDTH, break_long_words=False, break_on_hyphens=False)
        yield from (f"    {start}", *(f"        {piece}" for piece in pieces), f"    {end}")


def _call(bank: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    """The method of the runtime that a command is, with its arguments."""
    unit, speed = str(bank["unit"]), ", speed" if "speed" in command.get("parameters", {}) else ""
    release = ", release=True" if command.get("release") else ""
    calls = {
        "read_unit": f"read({unit}, fields)",
        "read_units": "read_all(fields)",
        "move_unit": f"move({unit}, position{speed})",
        "move_units": f"move_many(goals{speed})",
        "pose": f"pose(goals{speed}{release})",
        "set_torque": f"torque({unit}, on)",
        "stop": "stop()",
    }
    if command["do"] not in calls:
        raise TaskRefused(f"no template does {command['do']} for the tool {command['tool']}")
    return f"move_percent({unit}, percent{speed})" if command.get("scale") == "calibrated" else calls[command["do"]]
