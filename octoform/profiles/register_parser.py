"""Read the protocol definition of units on a bus: every problem of it with its place, or the protocol definition. Pure.

Every name must lead to a field that is declared and every number must fit where it is written, so that what a server
writes follows from the text alone, and no tool can be made to write anything else.
"""

from collections.abc import Callable, Mapping
from typing import Any

from octoform.frontmatter import Place
from octoform.patterns import regex
from octoform.profiles.definition_forms import MAX_BAUD, PRINTABLE, Found, is_value_name
from octoform.profiles.registers import (
    CALIBRATED,
    DOES,
    Action,
    Calibration,
    Library,
    Motion,
    Protect,
    Register,
    RegisterDefinition,
    Registers,
    Speed,
)

# Read the commands of a register definition: each does one thing of a closed list, with names that resolve. Pure.

MAX_COMMANDS, MAX_READ_FIELDS = 40, 20
COMMAND_FIELDS = ("tool", "do", "about", "fields", "scale", "pose", "release")
_MOVES = ("move_unit", "move_units", "pose")
_OF: Mapping[str, tuple[str, ...]] = {
    "fields": ("read_units", "read_unit"),
    "scale": ("move_unit",),
    "pose": ("pose",),
    "release": ("pose",),
}
"""The fields that only some commands have."""
_COMMANDS = 'write commands: [{tool: arm_read_joint, do: read_unit, about: "what a joint feels", fields: [position]}]'


def read_commands(found: Found, given: object, place: Place, registers: Registers) -> tuple[Action, ...]:
    """The commands; whatever they are, with every problem of them in ``found``."""
    items = found.items(given, place, MAX_COMMANDS, _COMMANDS)
    commands = [_command(found, item, (*place, index), registers) for index, item in enumerate(items)]
    found.distinct([(item.tool, (*place, index, "tool")) for index, item in enumerate(commands)])
    return tuple(commands)


def _command(found: Found, given: object, place: Place, registers: Registers) -> Action:
    item = found.mapping(given, place, "a command", COMMAND_FIELDS)
    tool, about = found.tool(item.get("tool"), (*place, "tool")), found.text(item, "about", place)
    do = found.named(item.get("do"), DOES, (*place, "do"), "thing that a command does")
    for name, whose in _OF.items():
        if name in item and do and do not in whose:
            found.add((*place, name), f"{name!r} is not of a command that does {do}", f"it is of {', '.join(whose)}")
    check = _CHECKS.get(do)
    if check is not None:
        check(found, item, place, registers)
    if do in (*_MOVES, "stop") and registers.motion is None:
        hint = "write under `motion` of the registers how a unit is moved"
        found.add((*place, "do"), f"{do} without a `motion` of the registers", hint)
    fields = item.get("fields") if do in _OF["fields"] else None
    return Action(
        tool=tool,
        do=do,
        about=about,
        fields=tuple(str(name) for name in fields) if isinstance(fields, list) else (),
        scale=item.get("scale"),
        pose=item.get("pose"),
        release=item.get("release") is True,
    )


def _reads(found: Found, item: Mapping[str, Any], place: Place, registers: Registers) -> None:
    where, fields = (*place, "fields"), item.get("fields")
    if not isinstance(fields, list) or not 1 <= len(fields) <= MAX_READ_FIELDS:
        hint = f"its fields are among {', '.join(registers.fields)}" if registers.fields else None
        found.add(where, f"the command does not list 1 to {MAX_READ_FIELDS} fields that it reads", hint)
        return
    for index, name in enumerate(fields):
        if found.named(name, registers.fields, (*where, index), "field") and name in fields[:index]:
            found.add((*where, index), f"the field {name!r} occurs twice")


def _moves(found: Found, item: Mapping[str, Any], place: Place, registers: Registers) -> None:
    if "scale" not in item:
        return
    if item["scale"] != CALIBRATED:
        hint = f"write scale: {CALIBRATED}, or leave it out for raw counts"
        found.add((*place, "scale"), f"{item['scale']!r} is no scale", hint)
    elif registers.calibration is None:
        hint = "name under `calibration` of the registers the files that hold it"
        found.add((*place, "scale"), "a calibrated scale without a `calibration` of the registers", hint)


def _poses(found: Found, item: Mapping[str, Any], place: Place, registers: Registers) -> None:
    found.named(item.get("pose"), registers.poses, (*place, "pose"), "pose")
    if not isinstance(item.get("release", False), bool):
        found.add((*place, "release"), "'release' is neither true nor false")
    elif item.get("release"):
        _releases(found, (*place, "release"), registers)


def _torque(found: Found, item: Mapping[str, Any], place: Place, registers: Registers) -> None:
    """Limp by `release`; held by what is written before a movement, so both have to speak of the same fields."""
    _releases(found, (*place, "do"), registers)
    motion = registers.motion
    held = {name for name, value in motion.before if isinstance(value, int)} if motion is not None else set()
    for name, _ in motion.release if motion is not None else ():
        if name not in held:
            hint = f"add {{{name}: 1}} to `before` of the motion, or the write that holds a unit"
            found.add((*place, "do"), f"{item['do']} can release {name!r} and not hold it again", hint)


def _releases(found: Found, place: Place, registers: Registers) -> None:
    if registers.motion is None or not registers.motion.release:
        hint = "write for example release: {torque: 0} under `motion` of the registers"
        found.add(place, "no setting makes a unit limp", hint)


_CHECKS: Mapping[str, Callable[[Found, Mapping[str, Any], Place, Registers], None]] = {
    "read_units": _reads,
    "read_unit": _reads,
    "move_unit": _moves,
    "pose": _poses,
    "set_torque": _torque,
}


# Read how the units of a bus are moved, protected, calibrated and posed. Pure.
#
# What is bounded here moves an arm, so each number fits where it is written, a pose names every unit, and positions
# lie within their bounds.

MOTION_FIELDS = (
    *("goal", "present", "lowest", "highest", "minimum", "maximum"),
    *("before", "speed", "moved", "timeout", "within", "release"),
)
SPEED_FIELDS = ("minimum", "maximum", "default", "unit")
PROTECT_FIELDS = ("field", "refuse_at", "resume_below", "unit")
CALIBRATION_FIELDS = ("format", "files")
FORMATS = ("lerobot",)
SPEED = "speed"
MAX_WRITES, MAX_FILES, MAX_POSES = 12, 10, 20
MAX_GLOB = 200
Fields = Mapping[str, Register]


def read_motion(found: Found, given: Mapping[str, Any], place: Place, fields: Fields) -> Motion | None:
    """How a unit is moved; None where nothing is."""
    if "motion" not in given:
        return None
    where = (*place, "motion")
    item = found.mapping(given["motion"], where, "the motion", MOTION_FIELDS)
    goal = found.named(item.get("goal"), fields, (*where, "goal"), "field")
    present = found.named(item.get("present"), fields, (*where, "present"), "field")
    ends = {
        end: found.named(item[end], fields, (*where, end), "field") if end in item else None
        for end in ("lowest", "highest")
    }
    low, high = span(fields, goal)
    minimum, maximum = (found.whole(item, bound, where, (low, high)) for bound in ("minimum", "maximum"))
    if minimum >= maximum:
        found.add((*where, "minimum"), "the minimum of a position is not below its maximum")
    speed = _speed(found, item, where)
    before = _before(found, item, where, fields, speed)
    return Motion(
        goal=goal,
        present=present,
        minimum=minimum,
        maximum=maximum,
        moved=found.whole(item, "moved", where, (1, max(1, maximum - minimum))),
        timeout=_timeout(found, item, where),
        before=before,
        lowest=ends["lowest"],
        highest=ends["highest"],
        speed=speed,
        release=_release(found, item, where, fields),
    )


def _timeout(found: Found, item: Mapping[str, Any], place: Place) -> float:
    """The longest time of a movement; ``within`` is the name that it had before."""
    former = "within" in item
    if former and "timeout" in item:
        found.add((*place, "within"), "'timeout' and 'within' are the same; write 'timeout' alone")
    return float(found.seconds(item, "within" if former else "timeout", place, (1, 60), 5))


def span(fields: Fields, name: str) -> tuple[int, int]:
    """The numbers that a field can hold: all of its bytes, or up to its sign bit in both directions."""
    register = fields.get(name)
    if register is None:
        return -(2**31), 2**32 - 1
    if register.sign_bit is not None:
        return -(2**register.sign_bit) + 1, 2**register.sign_bit - 1
    return 0, 256**register.bytes - 1


def _speed(found: Found, item: Mapping[str, Any], place: Place) -> Speed | None:
    if SPEED not in item:
        return None
    where = (*place, SPEED)
    speed = found.mapping(item[SPEED], where, "the speed", SPEED_FIELDS)
    low, high = (found.whole(speed, bound, where, (0, 2**31)) for bound in ("minimum", "maximum"))
    if low > high:
        found.add((*where, "minimum"), "the minimum of the speed is above its maximum")
        high = low
    return Speed(low, high, found.whole(speed, "default", where, (low, high)), found.unit(speed, where))


def _before(
    found: Found, item: Mapping[str, Any], place: Place, fields: Fields, speed: Speed | None
) -> tuple[tuple[str, int | str], ...]:
    """The writes before the goal, in this order."""
    where, given = (*place, "before"), item.get("before", [])
    if not isinstance(given, list) or len(given) > MAX_WRITES:
        hint = "write before: [{torque: 1}, {speed: speed}], in the order in which they are written"
        found.add(where, f"'before' is no list of at most {MAX_WRITES} writes", hint)
        return ()
    writes: list[tuple[str, int | str]] = []
    for index, step in enumerate(given):
        if not isinstance(step, Mapping) or len(step) != 1:
            found.add(
                (*where, index), "a write is a mapping of one field to its value", "write for example {torque: 1}"
            )
            continue
        ((name, value),) = step.items()
        writes.append((str(name), _written(found, str(name), value, (*where, index), fields, speed)))
    if speed is not None and SPEED not in (value for _, value in writes):
        hint = "write {speed: speed} into `before`: a field, and the parameter whose value it gets"
        found.add(where, "the speed of a movement is written nowhere", hint)
    return tuple(writes)


def _written(found: Found, name: str, value: object, place: Place, fields: Fields, speed: Speed | None) -> int | str:
    if not found.named(name, fields, (*place, name), "field"):
        return 0
    low, high = span(fields, name)
    if value == SPEED and speed is not None:
        if speed.minimum < low or speed.maximum > high:
            found.add((*place, name), f"the speed does not fit into {name!r}, which holds {low} to {high}")
        return SPEED
    if isinstance(value, str):
        hint = f"write a number, or {SPEED} for the parameter that `speed` of the motion declares"
        found.add((*place, name), f"{value!r} is no parameter of a movement", hint)
        return 0
    return found.whole({name: value}, name, place, (low, high))


def _release(found: Found, item: Mapping[str, Any], place: Place, fields: Fields) -> tuple[tuple[str, int], ...]:
    where, given = (*place, "release"), item.get("release", {})
    if not isinstance(given, Mapping) or len(given) > MAX_WRITES:
        hint = "write release: {torque: 0}"
        found.add(where, f"'release' is no mapping of at most {MAX_WRITES} fields to numbers", hint)
        return ()
    return tuple(
        (str(name), found.whole(given, name, where, span(fields, name)))
        for name in given
        if found.named(name, fields, (*where, name), "field")
    )


def protect(found: Found, given: Mapping[str, Any], place: Place, fields: Fields) -> Protect | None:
    """From which reading on a unit is not moved, and from which on it is again."""
    if "protect" not in given:
        return None
    where = (*place, "protect")
    item = found.mapping(given["protect"], where, "the protection", PROTECT_FIELDS)
    name = found.named(item.get("field"), fields, (*where, "field"), "field")
    refuse, resume = (found.number(item, bound, where) for bound in ("refuse_at", "resume_below"))
    if not resume < refuse:
        hint = "a unit that has just become too hot must cool down before it moves again"
        found.add((*where, "resume_below"), "'resume_below' is not below 'refuse_at'", hint)
    unit = found.unit(item, where)
    if name and unit != (fields[name].unit or unit):
        found.add((*where, "unit"), f"the protection is in {unit!r} and its field in {fields[name].unit!r}")
    return Protect(name, refuse, resume, unit or (fields[name].unit if name else ""))


def calibration(found: Found, given: Mapping[str, Any], place: Place, moved: Motion | None) -> Calibration | None:
    """Which files of the user say where each unit's range begins and ends."""
    if "calibration" not in given:
        return None
    where = (*place, "calibration")
    item = found.mapping(given["calibration"], where, "the calibration", CALIBRATION_FIELDS)
    if item.get("format") not in FORMATS:
        found.add((*where, "format"), "the format of the calibration is not known", f"known: {', '.join(FORMATS)}")
    if moved is None:
        found.add(where, "a calibration without a `motion` whose positions it is of")
    files = item.get("files")
    if not isinstance(files, list) or not 1 <= len(files) <= MAX_FILES:
        hint = 'write files: ["~/.cache/NAME/*.json"]'
        found.add((*where, "files"), f"'files' is no list of 1 to {MAX_FILES} patterns of files", hint)
        return Calibration(str(item.get("format")), ())
    for index, pattern in enumerate(files):
        if not _below_home(pattern):
            hint = "begin with ~/ and name folders; * matches any name, and neither .. nor ** is known"
            found.add((*where, "files", index), f"{pattern!r} is no pattern of files below the home folder", hint)
    return Calibration(str(item.get("format")), tuple(str(pattern) for pattern in files))


def _below_home(pattern: object) -> bool:
    if not isinstance(pattern, str) or len(pattern) > MAX_GLOB or not PRINTABLE.fullmatch(pattern):
        return False
    home, *parts = pattern.split("/")
    return home == "~" and bool(parts) and all(part not in ("", ".", "..") and "**" not in part for part in parts)


def poses(
    found: Found, given: Mapping[str, Any], place: Place, units: Mapping[str, int], moved: Motion | None
) -> dict[str, dict[str, int]]:
    """Positions of all units by the name of the pose."""
    where, listed = (*place, "poses"), given.get("poses", {})
    if not isinstance(listed, Mapping) or len(listed) > MAX_POSES:
        found.add(where, f"'poses' is no mapping of at most {MAX_POSES} poses", "write poses: {home: {base: 2048}}")
        return {}
    if listed and moved is None:
        found.add(where, "poses without a `motion` that takes a unit there")
    bounds = (moved.minimum, moved.maximum) if moved is not None else (0, 0)
    return {str(name): _pose(found, str(name), pose, (*where, name), units, bounds) for name, pose in listed.items()}


def _pose(
    found: Found, name: str, given: object, place: Place, units: Mapping[str, int], bounds: tuple[int, int]
) -> dict[str, int]:
    if not is_value_name(name):
        found.add(place, f"{name!r} is no usable name of a pose", "write a short word in lower case")
    pose = found.mapping(given, place, f"the pose {name!r}", tuple(units))
    absent = [unit for unit in units if unit not in pose]
    if absent and isinstance(given, Mapping):
        hint = "a pose has a position for every unit"
        found.add(place, f"the pose {name!r} lacks {', '.join(absent)}", hint)
    return {str(unit): found.whole(pose, unit, place, bounds) for unit in pose if unit in units}


FIELDS = ("registers", "commands")
REGISTERS_FIELDS = (
    *("class", "baud", "library", "units", "unit", "fields"),
    *("motion", "protect", "calibration", "poses"),
)
LIBRARY_FIELDS = ("distribution", "module", "protocol")
REGISTER_FIELDS = ("address", "bytes", "sign_bit", "scale", "unit")
BUS_CLASS = "tty"
MAX_UNITS, MAX_FIELDS = 32, 40
MAX_ID = 252
"""Ids above it are for all units at once, or for the bus itself."""
WIDTHS = (1, 2, 4)
MAX_PROTOCOL = 2
UNIT_TAKEN = ("position", "percent", "speed", "on")
FIELD_TAKEN = ("id", "skipped", "calibrated", "from", "moved")
"""The members of a result for each unit beside its fields."""
_DISTRIBUTION = regex(r"[A-Za-z0-9]+(?:[._-][A-Za-z0-9]+)*")
_MODULE = regex(r"[A-Za-z_][A-Za-z0-9_]*(?:\.[A-Za-z_][A-Za-z0-9_]*)*")
_LIBRARY = "write library: {distribution: name-on-pypi, module: imported_as, protocol: 0}"


def read(found: Found, whole: Mapping[str, Any], place: Place) -> RegisterDefinition:
    """The protocol definition of a front-matter value, with every problem of it in ``found``."""
    found.mapping(whole, place, "the protocol definition", FIELDS)
    registers = _registers(found, whole.get("registers"), (*place, "registers"))
    return RegisterDefinition(registers, read_commands(found, whole.get("commands"), (*place, "commands"), registers))


def _registers(found: Found, given: object, place: Place) -> Registers:
    item = found.mapping(given, place, "the registers of the protocol definition", REGISTERS_FIELDS)
    if item.get("class") != BUS_CLASS:
        found.add((*place, "class"), f"the class of the bus is not {BUS_CLASS}", f"write class: {BUS_CLASS}")
    baud = found.whole(item, "baud", place, (1, MAX_BAUD))
    library = _library(found, item.get("library"), (*place, "library"))
    unit = item.get("unit", "unit")
    if not isinstance(unit, str) or not is_value_name(unit, (*UNIT_TAKEN, *FIELD_TAKEN)):
        hint = "write unit: joint, a short word in lower case: the parameter that names the unit"
        found.add((*place, "unit"), "what a unit is called is no usable name of a parameter", hint)
        unit = "unit"
    units = _units(found, item.get("units"), (*place, "units"), unit)
    fields = _fields(found, item.get("fields"), (*place, "fields"), unit)
    motion = read_motion(found, item, place, fields)
    return Registers(
        kind=BUS_CLASS,
        baud=baud,
        library=library,
        units=units,
        unit=unit,
        fields=fields,
        motion=motion,
        protect=protect(found, item, place, fields),
        calibration=calibration(found, item, place, motion),
        poses=poses(found, item, place, units, motion),
    )


def _library(found: Found, given: object, place: Place) -> Library:
    item = found.mapping(given, place, "the library", LIBRARY_FIELDS)
    words = {}
    for name, form in (("distribution", _DISTRIBUTION), ("module", _MODULE)):
        word = item.get(name)
        if not (isinstance(word, str) and form.fullmatch(word) and len(word) <= 100):
            found.add((*place, name), f"the {name} of the library is no usable name", _LIBRARY)
        words[name] = str(word)
    return Library(words["distribution"], words["module"], found.whole(item, "protocol", place, (0, MAX_PROTOCOL), 0))


def _units(found: Found, given: object, place: Place, unit: str) -> dict[str, int]:
    if not isinstance(given, Mapping) or not 1 <= len(given) <= MAX_UNITS:
        hint = "write units: {base: 1, tip: 2}, each with its id on the bus"
        found.add(place, f"'units' is no mapping of 1 to {MAX_UNITS} units", hint)
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
        number = found.whole(given, name, place, (0, MAX_ID))
        if number in ids.values() and number == given[name]:
            hint = "two units with one id answer at once, and no one is understood"
            found.add((*place, name), f"the id {number} of {name!r} is another unit's already", hint)
        ids[str(name)] = number
    return ids


def _fields(found: Found, given: object, place: Place, unit: str) -> dict[str, Register]:
    if not isinstance(given, Mapping) or not 1 <= len(given) <= MAX_FIELDS:
        hint = "write fields: {position: {address: 56, bytes: 2, unit: raw}}"
        found.add(place, f"'fields' is no mapping of 1 to {MAX_FIELDS} fields", hint)
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
