"""The tools of a product's grammar: exactly one for each command, with its name, its effect and its parameters.

Bounds are those of the protocol definition, narrowed by the limits of its profile, and are in the schema as well as in
the tool's limits, so that a client sees what the endpoint enforces.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.description.class_model import (
    FLAG,
    NUMBER,
    TEXT,
    WHOLE,
    Kind,
    Schema,
    listing,
    maybe,
    one_of,
    record,
)
from octoform.builtin.task import Profiles, TaskRefused, commands, parameters
from octoform.patterns import regex

# The answers of a protocol definition's tools, as schemas and in the sentences of their descriptions.
#
# An answer of a line is the raw line, or the typed fields of its pattern. An answer about units on a register bus is
# one record for each unit, whose members are null where the unit was skipped.

DONE = record("LineDone", device=TEXT, command=TEXT, answer=TEXT)
SENT = record("LineSent", device=TEXT, command=TEXT, acknowledged=FLAG)
_FIELDS = {"integer": WHOLE, "number": NUMBER, "string": TEXT, "boolean": FLAG}
_ACTS = ("move_unit", "move_units", "pose")


def of_line(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> Schema:
    """The answer of a command of a line protocol."""
    title = f"{_title(command)}Answer"
    if command.get("do") == "position":
        axes = {axis: maybe(WHOLE) for axis in grammar["position"]["axes"]}
        return record(title, device=TEXT, **axes, unknown=maybe(TEXT))
    if command.get("do") == "stop":
        return record(title, device=TEXT, stopped=FLAG, until=TEXT, note=TEXT)
    fields = command.get("fields") or {}
    if not fields:
        return SENT if is_unanswered(grammar, command) else DONE
    return record(title, device=TEXT, **{name: _FIELDS[value["type"]] for name, value in fields.items()})


def is_unanswered(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> bool:
    """Whether the product answers nothing to a command that it carries out."""
    return "do" not in command and "reply" not in command and "ok" not in grammar["line"]


def of_units(bank: Mapping[str, Any], command: Mapping[str, Any]) -> Schema:
    """The answer of a tool that reads or drives units: a record, or a list of them that is named after the units."""
    unit, title = str(bank["unit"]), _title(command)
    members = _members(bank, command)
    if command["do"] in ("read_unit", "move_unit", "set_torque"):
        return record(f"{title}Answer", device=TEXT, **members)
    note = {"calibration": maybe(TEXT)} if command["do"] == "read_units" else {}
    one = record(f"{title}{_words(unit)}", **members)
    return record(f"{title}Answer", device=TEXT, **note, **{f"{unit}s": listing(one)})


def of_motion(bank: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    """The notes for a caller beside a tool's own description, as sentences that begin with a blank."""
    unit, off = str(bank["unit"]), bank["disabled"]
    lines = [f"Disabled: {', '.join(off)}."] if off and command["do"] != "stop" else []
    if command["do"].startswith("read"):
        units = [
            f"{name} in {bank['fields'][name]['unit']}"
            for name in command["fields"]
            if bank["fields"][name].get("unit")
        ]
        lines.insert(
            0, f"Returns {', '.join(units)}; calibrated in percent of the range, null where unknown." if units else ""
        )
    if command["do"] in _ACTS:
        timeout = bank["motion"]["timeout"]
        lines.insert(
            0, f"Returns when it has stopped, after {timeout:g} s at most; one that does not move is an error."
        )
    if command.get("scale") == "calibrated":
        lines.insert(0, f"The scale of each {unit}, a gripper too: -100 and 100 are the ends of its calibrated range.")
    if command.get("release"):
        lines.append(f"Each {unit} that came there is made limp.")
    return "".join(f" {sentence}" for sentence in lines if sentence)


def _members(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Schema]:
    unit, do = str(bank["unit"]), command["do"]
    named, skipped = {unit: TEXT}, {"skipped": maybe(TEXT)}
    if do in _ACTS:
        goal = {"from": maybe(WHOLE), "goal": WHOLE, "position": maybe(WHOLE), "moved": FLAG}
        return {**named, **goal, **skipped, **({"released": FLAG} if command.get("release") else {})}
    known = {**named, "id": WHOLE, **skipped}
    if do == "stop":
        return {**known, "position": maybe(WHOLE)}
    if do == "set_torque":
        return {**known, "on": maybe(FLAG)}
    fields = {name: maybe(_field(bank["fields"][name])) for name in command["fields"]}
    return {**known, **fields, "calibrated": maybe(NUMBER)}


def _field(field: Mapping[str, Any]) -> Schema:
    kind = WHOLE if field.get("scale", 1) == 1 else NUMBER
    unit = field.get("unit", "raw")
    return {**kind, "description": unit if unit == "raw" else f"in {unit}"}


def _title(command: Mapping[str, Any]) -> str:
    return _words(str(command["tool"]))


def _words(name: str) -> str:
    return "".join(word.capitalize() for word in name.split("_"))


# Which units of a device a tool acts on, by the protocol definition of its profile: joints on a bus, axes of a rail.
#
# The endpoint needs it to hold a restriction or a range of one unit whichever tool reaches that unit.

_MOVES = ("move_unit", "move_units", "pose")
OFF = 60
"""How far from its goal a unit may stand for the runtime to say that it came there."""
_NAMED = ("move_unit", "set_torque")


def acted_on(grammar: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """The ``units`` of the tool of a command; empty for one that reads or stops, and where no units are described."""
    if command["effect"] == "read" or command.get("do") == "stop":
        return {}
    bank = grammar.get("registers")
    return _of_bank(bank, command) if bank else _of_axes(grammar.get("position") or {}, command)


def _of_bank(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    do, ids = command["do"], bank["units"]
    acted = bank["poses"][command["pose"]] if do == "pose" else ids
    fields: dict[str, Any] = {"names": {name: [str(ids[name])] for name in acted}}
    if do in _NAMED:
        fields["parameter"] = str(bank["unit"])
    if do == "move_units":
        fields["parameters"] = {name: name for name in command["parameters"] if name in ids}
    if do in _MOVES:
        fields["goal"] = _goal(bank, command)
        fields["reports"] = _reports(bank, command)
    return fields


def _reports(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    """The member of the answer with the positions of the units."""
    unit = str(bank["unit"])
    records = {} if command["do"] == "move_unit" else {"records": f"{unit}s"}
    return {"field": "position", **records, "unit": unit, "within": OFF}


def _goal(bank: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    motion = bank["motion"]
    unit = bank["fields"][motion["goal"]].get("unit")
    goal = {"of": "position", "minimum": motion["minimum"], "maximum": motion["maximum"]}
    goal |= {"unit": unit} if unit else {}
    if command["do"] == "pose":
        goal["fixed"] = dict(bank["poses"][command["pose"]])
    elif command["do"] == "move_unit" and not command.get("scale"):
        goal["parameter"] = "position"
    return goal


def _of_axes(position: Mapping[str, Any], command: Mapping[str, Any]) -> dict[str, Any]:
    axes = position.get("axes") or {}
    own = [name for name, axis in axes.items() if axis["tool"] == command["tool"]]
    acted = list(axes) if command["tool"] == position.get("zero") else own
    return {"names": {name: [] for name in acted}} if acted else {}


WORTH = 95
"""The weight of a tool that a person described, above that of every tool that was merely found."""
_WORD = regex(r"[^\s,;:()]+")
_IDEMPOTENT = ("stop", "set_torque", "pose", "move_unit", "move_units")
"""The idempotent actions: they name a goal, and no distance from the present position."""
_TYPES = {"integer": WHOLE, "number": NUMBER, "string": TEXT, "boolean": FLAG}


def kinds(profiles: Profiles, taken: Mapping[str, Kind]) -> dict[str, Kind]:
    """A tool for each command of each protocol definition; TaskRefused for a name that the catalog has already."""
    found = {}
    for name, (profile, command) in commands(profiles).items():
        if name in taken:
            raise TaskRefused(
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
        output=of_units(bank, command) if bank else of_line(profile["grammar"], command),
        worth=WORTH + (bank is not None and command["do"] == "stop"),  # nothing that moves is kept without its stop
        effect=str(command["effect"]),
        parameters=lambda _: {name: _schema(name, value) for name, value in values.items()},
        smoke=trial if is_read else {},
        units={name: str(value["unit"]) for name, value in values.items() if value.get("unit")},
        idempotent=is_read or command.get("do") in _IDEMPOTENT,
        stops=command.get("do") == "stop",
        acts_on=acted_on(profile["grammar"], command),
    )


def _description(profile: Mapping[str, Any], command: Mapping[str, Any]) -> str:
    about = str(command["about"]).strip()
    sentence = about[:1].upper() + about[1:] + ("" if about.endswith((".", "!", "?")) else ".")
    if bank := profile["grammar"].get("registers"):
        more = of_motion(bank, command)
        return f"{sentence}{more} By the registers of the profile {profile['name']}."
    units = [f"{name} in {value['unit']}" for name, value in (command.get("fields") or {}).items() if value.get("unit")]
    text = f" Returns {', '.join(units)}." if units else ""
    if is_unanswered(profile["grammar"], command):
        text += " The device acknowledges nothing: that it was sent is all that is known."
    if not command.get("send", "do" in command):
        text += f" Waits up to {profile['grammar']['line']['timeout']:g} s for the device to send it by itself."
    return f"{sentence}{text} By the line protocol of the profile {profile['name']}."


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
    """A value that the parameter takes, for a test call of a read; no unit that is ``off`` where there is another."""
    if value["type"] == "boolean":
        return False
    if "enum" in value:
        return next((word for word in value["enum"] if word not in off), value["enum"][0])
    return value.get("minimum", 0)
