"""Read the grammar of units on a bus: every problem of it with its place, or the grammar. Pure.

Every name must lead to a field that is declared and every number must fit where it is written, so that what a server
writes follows from the text alone, and no tool can be made to write anything else.
"""

import re
from collections.abc import Mapping
from typing import Any

from octoform.frontmatter import Place
from octoform.profiles.definitions import register_motion
from octoform.profiles.definitions.problems import MOST_BAUD, Found, is_value_name
from octoform.profiles.definitions.register_commands import read as read_commands
from octoform.profiles.definitions.registers import Library, Register, RegisterGrammar, Registers

FIELDS = ("registers", "commands")
REGISTERS_FIELDS = (
    *("class", "baud", "library", "units", "unit", "fields"),
    *("motion", "protect", "calibration", "poses"),
)
LIBRARY_FIELDS = ("distribution", "module", "protocol")
REGISTER_FIELDS = ("address", "bytes", "sign_bit", "scale", "unit")
BUS_CLASS = "tty"
MOST_UNITS, MOST_FIELDS = 32, 40
MOST_ID = 252
"""Ids above it are for all units at once, or for the bus itself."""
WIDTHS = (1, 2, 4)
MOST_PROTOCOL = 2
UNIT_TAKEN = ("position", "percent", "speed", "on")
FIELD_TAKEN = ("id", "skipped", "calibrated", "from", "moved")
"""What a result says of each unit beside its fields."""
_DISTRIBUTION = re.compile(r"[A-Za-z0-9]+(?:[._-][A-Za-z0-9]+)*")
_MODULE = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*")
_LIBRARY = "write library: {distribution: name-on-pypi, module: imported_as, protocol: 0}"


def read(found: Found, whole: Mapping[str, Any], place: Place) -> RegisterGrammar:
    """The grammar that a front-matter value says; whatever it is, with every problem of it in ``found``."""
    found.mapping(whole, place, "the grammar", FIELDS)
    registers = _registers(found, whole.get("registers"), (*place, "registers"))
    return RegisterGrammar(registers, read_commands(found, whole.get("commands"), (*place, "commands"), registers))


def _registers(found: Found, given: object, place: Place) -> Registers:
    item = found.mapping(given, place, "the registers of the grammar", REGISTERS_FIELDS)
    if item.get("class") != BUS_CLASS:
        found.add((*place, "class"), f"the class of the bus is not {BUS_CLASS}", f"write class: {BUS_CLASS}")
    baud = found.whole(item, "baud", place, (1, MOST_BAUD))
    library = _library(found, item.get("library"), (*place, "library"))
    unit = item.get("unit", "unit")
    if not isinstance(unit, str) or not is_value_name(unit, (*UNIT_TAKEN, *FIELD_TAKEN)):
        hint = "write unit: joint, a short word in lower case: the parameter that says which one is meant"
        found.add((*place, "unit"), "what a unit is called is no usable name of a parameter", hint)
        unit = "unit"
    units = _units(found, item.get("units"), (*place, "units"), unit)
    fields = _fields(found, item.get("fields"), (*place, "fields"), unit)
    motion = register_motion.motion(found, item, place, fields)
    return Registers(
        kind=BUS_CLASS,
        baud=baud,
        library=library,
        units=units,
        unit=unit,
        fields=fields,
        motion=motion,
        protect=register_motion.protect(found, item, place, fields),
        calibration=register_motion.calibration(found, item, place, motion),
        poses=register_motion.poses(found, item, place, units, motion),
    )


def _library(found: Found, given: object, place: Place) -> Library:
    item = found.mapping(given, place, "the library", LIBRARY_FIELDS)
    words = {}
    for name, form in (("distribution", _DISTRIBUTION), ("module", _MODULE)):
        word = item.get(name)
        if not (isinstance(word, str) and form.fullmatch(word) and len(word) <= 100):
            found.add((*place, name), f"the {name} of the library is no usable name", _LIBRARY)
        words[name] = str(word)
    return Library(words["distribution"], words["module"], found.whole(item, "protocol", place, (0, MOST_PROTOCOL), 0))


def _units(found: Found, given: object, place: Place, unit: str) -> dict[str, int]:
    if not isinstance(given, Mapping) or not 1 <= len(given) <= MOST_UNITS:
        hint = "write units: {base: 1, tip: 2}, each with its id on the bus"
        found.add(place, f"'units' is no mapping of 1 to {MOST_UNITS} units", hint)
        return {}
    for name in given:
        if not (isinstance(name, str) and is_value_name(name, (*UNIT_TAKEN, unit))):
            hint = "write a short word in lower case that is no other parameter of the tools"
            found.add((*place, name), f"{name!r} is no usable name of a unit", hint)
    return numbered(found, given, place)


def numbered(found: Found, given: Mapping[str, Any], place: Place) -> dict[str, int]:
    """Ids on the bus by the names of the units, each once."""
    ids: dict[str, int] = {}
    for name in given:
        number = found.whole(given, name, place, (0, MOST_ID))
        if number in ids.values() and number == given[name]:
            hint = "two units with one id answer at once, and nobody is understood"
            found.add((*place, name), f"the id {number} of {name!r} is another unit's already", hint)
        ids[str(name)] = number
    return ids


def _fields(found: Found, given: object, place: Place, unit: str) -> dict[str, Register]:
    if not isinstance(given, Mapping) or not 1 <= len(given) <= MOST_FIELDS:
        hint = "write fields: {position: {address: 56, bytes: 2, unit: raw}}"
        found.add(place, f"'fields' is no mapping of 1 to {MOST_FIELDS} fields", hint)
        return {}
    return {str(name): _field(found, str(name), value, (*place, name), unit) for name, value in given.items()}


def _field(found: Found, name: str, given: object, place: Place, unit: str) -> Register:
    item = found.mapping(given, place, f"the field {name!r}", REGISTER_FIELDS)
    if not is_value_name(name, (*FIELD_TAKEN, unit)):
        found.add(place, f"{name!r} is no usable name of a field", "write a short word in lower case")
    address = found.whole(item, "address", place, (0, 255))
    width = item.get("bytes")
    if not isinstance(width, int) or isinstance(width, bool) or width not in WIDTHS:
        found.add((*place, "bytes"), "'bytes' is none of 1, 2 and 4", "the library reads and writes no other widths")
        width = WIDTHS[0]
    elif address + width > 256:
        found.add((*place, "bytes"), f"{width} bytes at the address {address} do not end within 0..255")
    sign = found.whole(item, "sign_bit", place, (1, 8 * width - 1)) if "sign_bit" in item else None
    scale = found.number(item, "scale", place) if "scale" in item else None
    if scale is not None and scale <= 0:
        found.add((*place, "scale"), "'scale' is not above 0", "one count is worth that much of the unit")
    return Register(address, width, sign, scale, found.unit(item, place))
