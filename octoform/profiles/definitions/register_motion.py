"""Read how the units of a bus are moved, protected, calibrated and posed. Pure.

What is bounded here moves an arm, so each number fits where it is written, a pose names every unit, and positions
lie within their bounds.
"""

from collections.abc import Mapping
from typing import Any

from octoform.frontmatter import Place
from octoform.profiles.definitions.problems import PRINTABLE, Found, is_value_name
from octoform.profiles.definitions.registers import Calibration, Motion, Protect, Register, Speed

MOTION_FIELDS = (
    *("goal", "present", "lowest", "highest", "minimum", "maximum"),
    *("before", "speed", "moved", "within", "release"),
)
SPEED_FIELDS = ("minimum", "maximum", "default", "unit")
PROTECT_FIELDS = ("field", "refuse_at", "resume_below", "unit")
CALIBRATION_FIELDS = ("format", "files")
FORMATS = ("lerobot",)
SPEED = "speed"
MOST_WRITES, MOST_FILES, MOST_POSES = 12, 10, 20
LONGEST_GLOB = 200
Fields = Mapping[str, Register]


def motion(found: Found, given: Mapping[str, Any], place: Place, fields: Fields) -> Motion | None:
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
        within=float(found.seconds(item, "within", where, (1, 60), 5)),
        before=before,
        lowest=ends["lowest"],
        highest=ends["highest"],
        speed=speed,
        release=_release(found, item, where, fields),
    )


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
    """What is written before the goal, in this order."""
    where, given = (*place, "before"), item.get("before", [])
    if not isinstance(given, list) or len(given) > MOST_WRITES:
        hint = "write before: [{torque: 1}, {speed: speed}], in the order in which they are written"
        found.add(where, f"'before' is no list of at most {MOST_WRITES} writes", hint)
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
    if not isinstance(given, Mapping) or len(given) > MOST_WRITES:
        hint = "write release: {torque: 0}"
        found.add(where, f"'release' is no mapping of at most {MOST_WRITES} fields to numbers", hint)
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
    if not isinstance(files, list) or not 1 <= len(files) <= MOST_FILES:
        hint = 'write files: ["~/.cache/NAME/*.json"]'
        found.add((*where, "files"), f"'files' is no list of 1 to {MOST_FILES} patterns of files", hint)
        return Calibration(str(item.get("format")), ())
    for index, pattern in enumerate(files):
        if not _below_home(pattern):
            hint = "begin with ~/ and name folders; * stands for any name, and neither .. nor ** is known"
            found.add((*where, "files", index), f"{pattern!r} is no pattern of files below the home folder", hint)
    return Calibration(str(item.get("format")), tuple(str(pattern) for pattern in files))


def _below_home(pattern: object) -> bool:
    if not isinstance(pattern, str) or len(pattern) > LONGEST_GLOB or not PRINTABLE.fullmatch(pattern):
        return False
    home, *parts = pattern.split("/")
    return home == "~" and bool(parts) and all(part not in ("", ".", "..") and "**" not in part for part in parts)


def poses(
    found: Found, given: Mapping[str, Any], place: Place, units: Mapping[str, int], moved: Motion | None
) -> dict[str, dict[str, int]]:
    """Positions of all units by the name of the pose."""
    where, listed = (*place, "poses"), given.get("poses", {})
    if not isinstance(listed, Mapping) or len(listed) > MOST_POSES:
        found.add(where, f"'poses' is no mapping of at most {MOST_POSES} poses", "write poses: {home: {base: 2048}}")
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
        hint = "a pose says where every unit is; what is left where it happens to be is no pose"
        found.add(place, f"the pose {name!r} lacks {', '.join(absent)}", hint)
    return {str(unit): found.whole(pose, unit, place, bounds) for unit in pose if unit in units}
