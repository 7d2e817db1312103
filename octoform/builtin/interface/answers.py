"""What the tools of a product's grammar answer, as schemas and in the sentences of their descriptions.

An answer of a line is what was said, or the typed fields of its pattern. An answer about units on a register bus is one
record for each unit, whose members are null where the unit was skipped.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, Schema, listing, maybe, record

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
    """Whether the product says nothing to a command that it carries out."""
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
    """What a caller has to know of a tool beside its own words, as sentences that begin with a blank."""
    unit, off = str(bank["unit"]), bank["disabled"]
    told = [f"Disabled: {', '.join(off)}."] if off and command["do"] != "stop" else []
    if command["do"].startswith("read"):
        units = [
            f"{name} in {bank['fields'][name]['unit']}"
            for name in command["fields"]
            if bank["fields"][name].get("unit")
        ]
        told.insert(
            0, f"Returns {', '.join(units)}; calibrated in percent of the range, null where unknown." if units else ""
        )
    if command["do"] in _ACTS:
        within = bank["motion"]["within"]
        told.insert(0, f"Returns when it stands, after {within:g} s at most; one that does not move is an error.")
    if command.get("scale") == "calibrated":
        told.insert(0, f"The scale of each {unit}, a gripper too: -100 and 100 are the ends of its calibrated range.")
    if command.get("release"):
        told.append(f"Each {unit} that came there is made limp.")
    return "".join(f" {sentence}" for sentence in told if sentence)


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
