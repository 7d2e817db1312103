"""Read the commands of a grammar of registers: each does one thing of a closed list, with names that resolve. Pure."""

from collections.abc import Callable, Mapping
from typing import Any

from octoform.frontmatter import Place
from octoform.profiles.definitions.problems import Found
from octoform.profiles.definitions.registers import CALIBRATED, DOES, Action, Registers

MOST_COMMANDS, MOST_TOLD = 40, 20
FIELDS = ("tool", "do", "about", "fields", "scale", "pose", "release")
_MOVES = ("move_unit", "move_units", "pose")
_OF: Mapping[str, tuple[str, ...]] = {
    "fields": ("read_units", "read_unit"),
    "scale": ("move_unit",),
    "pose": ("pose",),
    "release": ("pose",),
}
"""The fields that only some commands have."""
_COMMANDS = 'write commands: [{tool: arm_read_joint, do: read_unit, about: "what a joint feels", fields: [position]}]'


def read(found: Found, given: object, place: Place, registers: Registers) -> tuple[Action, ...]:
    """The commands; whatever they are, with every problem of them in ``found``."""
    items = found.items(given, place, MOST_COMMANDS, _COMMANDS)
    commands = [_command(found, item, (*place, index), registers) for index, item in enumerate(items)]
    found.distinct([(item.tool, (*place, index, "tool")) for index, item in enumerate(commands)])
    return tuple(commands)


def _command(found: Found, given: object, place: Place, registers: Registers) -> Action:
    item = found.mapping(given, place, "a command", FIELDS)
    tool, about = found.tool(item.get("tool"), (*place, "tool")), found.text(item, "about", place)
    do = found.named(item.get("do"), DOES, (*place, "do"), "thing that a command does")
    for name, whose in _OF.items():
        if name in item and do and do not in whose:
            found.add((*place, name), f"{name!r} is not of a command that does {do}", f"it is of {', '.join(whose)}")
    check = _CHECKS.get(do)
    if check is not None:
        check(found, item, place, registers)
    if do in (*_MOVES, "stop") and registers.motion is None:
        hint = "say under `motion` of the registers how a unit is moved"
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
    if not isinstance(fields, list) or not 1 <= len(fields) <= MOST_TOLD:
        hint = f"its fields are among {', '.join(registers.fields)}" if registers.fields else None
        found.add(where, f"the command does not list 1 to {MOST_TOLD} fields that it reads", hint)
        return
    for index, name in enumerate(fields):
        if found.named(name, registers.fields, (*where, index), "field") and name in fields[:index]:
            found.add((*where, index), f"the field {name!r} stands twice")


def _moves(found: Found, item: Mapping[str, Any], place: Place, registers: Registers) -> None:
    if "scale" not in item:
        return
    if item["scale"] != CALIBRATED:
        hint = f"write scale: {CALIBRATED}, or leave it out for raw counts"
        found.add((*place, "scale"), f"{item['scale']!r} is no scale", hint)
    elif registers.calibration is None:
        hint = "say under `calibration` of the registers which files hold it"
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
            hint = f"add {{{name}: 1}} to `before` of the motion, or whatever holds a unit"
            found.add((*place, "do"), f"{item['do']} can release {name!r} and not hold it again", hint)


def _releases(found: Found, place: Place, registers: Registers) -> None:
    if registers.motion is None or not registers.motion.release:
        hint = "write for example release: {torque: 0} under `motion` of the registers"
        found.add(place, "nothing says what makes a unit limp", hint)


_CHECKS: Mapping[str, Callable[[Found, Mapping[str, Any], Place, Registers], None]] = {
    "read_units": _reads,
    "read_unit": _reads,
    "move_unit": _moves,
    "pose": _poses,
    "set_torque": _torque,
}
