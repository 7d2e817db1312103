"""The protocol definition of units on a bus that are driven by their registers, as data. Pure.

Servos, drives and sensors of many makers are read and moved by the values at their addresses, behind a public library.
The protocol definition states which addresses, in which order they are written and within which limits. What a tool
does is one of a short closed list, so no tool writes an address of a caller's choice.
"""

from collections.abc import Mapping
from typing import Any

from octoform.profiles.definition_forms import Tool, Value, plain_values, present
from octoform.records import dataclass, field

READS = ("read_units", "read_unit")
DOES = (*READS, "move_unit", "move_units", "pose", "set_torque", "stop")
CALIBRATED = "calibrated"


@dataclass(frozen=True, slots=True)
class Library:
    """The public package behind which the bus is: ``module`` has a PortHandler and a PacketHandler(protocol)."""

    distribution: str
    module: str
    protocol: int


@dataclass(frozen=True, slots=True)
class Register:
    """The register at an address; ``sign_bit`` marks a negative value, ``scale`` turns counts into ``unit``."""

    address: int
    bytes: int
    sign_bit: int | None = None
    scale: float | None = None
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Speed:
    """The speed of a movement, a parameter of the tools that move."""

    minimum: int
    maximum: int
    default: int
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Motion:
    """How a unit is moved: names of fields, and the bounds of a position in counts.

    ``before`` is written in this order before the goal; a word there names the parameter ``speed``. ``release`` makes
    a unit limp. ``moved`` counts at least make a movement, ``timeout`` seconds at most are waited for it.
    """

    goal: str
    present: str
    minimum: int
    maximum: int
    moved: int
    timeout: float
    before: tuple[tuple[str, int | str], ...] = ()
    lowest: str | None = None
    highest: str | None = None
    speed: Speed | None = None
    release: tuple[tuple[str, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Protect:
    """No unit is moved from ``refuse_at`` on until the field is below ``resume_below`` again."""

    field: str
    refuse_at: float
    resume_below: float
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Calibration:
    """Files of the user's home that say where each unit's range begins and ends; globs that begin with ``~/``."""

    format: str
    files: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Registers:
    """The bus and its units: ids by name, of the product and (``renumbered``, ``disabled``) of the owner's own copy."""

    kind: str
    baud: int
    library: Library
    units: Mapping[str, int]
    unit: str
    fields: Mapping[str, Register]
    motion: Motion | None = None
    protect: Protect | None = None
    calibration: Calibration | None = None
    poses: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    renumbered: Mapping[str, int] = field(default_factory=dict)
    disabled: Mapping[str, str] = field(default_factory=dict)

    @property
    def ids(self) -> dict[str, int]:
        """The bus ids of this very copy."""
        return {**self.units, **self.renumbered}


@dataclass(frozen=True, slots=True)
class Action:
    """One command and the tool that it becomes; ``fields`` are what a read returns."""

    tool: str
    do: str
    about: str
    fields: tuple[str, ...] = ()
    scale: str | None = None
    pose: str | None = None
    release: bool = False


@dataclass(frozen=True, slots=True)
class RegisterDefinition:
    """All that may be done with a product whose units are driven by their registers."""

    registers: Registers
    commands: tuple[Action, ...]

    def tools(self) -> tuple[Tool, ...]:
        """One tool for each command; its effect and its parameters follow from what it does."""
        return tuple(
            Tool(
                item.tool,
                item.about,
                "read" if item.do in READS else "actuate",
                parameters(self.registers, item),
                item.do,
            )
            for item in self.commands
        )


def parameters(registers: Registers, command: Action) -> tuple[Value, ...]:
    """The parameters of a command, each within the bounds of the protocol definition."""
    unit = registers.unit
    ids = (str(number) for number in registers.ids.values())
    one = Value(unit, "string", f"which {unit}, by its name or its id", choices=(*registers.units, *ids))
    if command.do == "read_unit":
        return (one,)
    if command.do == "set_torque":
        return (one, Value("on", "boolean", f"true holds the {unit}, false makes it limp"))
    motion = registers.motion
    if motion is None or command.do not in ("move_unit", "move_units", "pose"):
        return ()
    speed = _speed(motion)
    if command.do == "pose":
        return speed
    if command.do == "move_units":
        return (*(_goal(registers, motion, name, f"goal of {name}") for name in registers.units), *speed)
    if command.scale == CALIBRATED:
        about = f"goal within the calibrated range of the {unit}"
        return (one, Value("percent", "number", about, "%", -100, 100), *speed)
    return (one, _goal(registers, motion, "position", f"goal of the {unit}"), *speed)


def _goal(registers: Registers, motion: Motion, name: str, about: str) -> Value:
    return Value(name, "integer", about, registers.fields[motion.goal].unit, motion.minimum, motion.maximum)


def _speed(motion: Motion) -> tuple[Value, ...]:
    speed = motion.speed
    if speed is None:
        return ()
    about = "speed of the movement"
    return (Value("speed", "integer", about, speed.unit, speed.minimum, speed.maximum, default=speed.default),)


def plain(grammar: RegisterDefinition, *, of_product: bool = False) -> dict[str, Any]:
    """The protocol definition as JSON, the bus ids and disabled units being those of the rig unless ``of_product``."""
    registers = grammar.registers
    library, protect, calibration = registers.library, registers.protect, registers.calibration
    fields: dict[str, Any] = {
        "class": registers.kind,
        "baud": registers.baud,
        "library": {"distribution": library.distribution, "module": library.module, "protocol": library.protocol},
        "units": dict(registers.units) if of_product else registers.ids,
        "disabled": {} if of_product else dict(registers.disabled),
        "unit": registers.unit,
        "fields": {name: _register(item) for name, item in registers.fields.items()},
        "motion": _motion(registers.motion) if registers.motion is not None else None,
    }
    if protect is not None:
        span = {"refuse_at": protect.refuse_at, "resume_below": protect.resume_below}
        fields["protect"] = present({"field": protect.field, **span, "unit": protect.unit or None})
    if calibration is not None:
        fields["calibration"] = {"format": calibration.format, "files": list(calibration.files)}
    fields["poses"] = {name: dict(pose) for name, pose in registers.poses.items()}
    pairs = zip(grammar.commands, grammar.tools(), strict=True)
    return {"registers": present(fields), "commands": [_command(*pair) for pair in pairs]}


def _register(item: Register) -> dict[str, Any]:
    more = {"sign_bit": item.sign_bit, "scale": item.scale, "unit": item.unit or None}
    return present({"address": item.address, "bytes": item.bytes, **more})


def _motion(motion: Motion) -> dict[str, Any]:
    speed = motion.speed
    rate = {"minimum": speed.minimum, "maximum": speed.maximum, "default": speed.default} if speed is not None else {}
    return present(
        {
            "goal": motion.goal,
            "present": motion.present,
            "lowest": motion.lowest,
            "highest": motion.highest,
            "minimum": motion.minimum,
            "maximum": motion.maximum,
            "before": [{name: value} for name, value in motion.before],
            "speed": {**rate, "unit": speed.unit} if speed is not None else None,
            "moved": motion.moved,
            "timeout": motion.timeout,
            "release": dict(motion.release),
        }
    )


def _command(command: Action, tool: Tool) -> dict[str, Any]:
    fields = {"tool": tool.tool, "do": tool.do, "about": tool.about, "effect": tool.effect}
    more = {"fields": list(command.fields) or None, "scale": command.scale, "pose": command.pose}
    return present({**fields, "parameters": plain_values(tool.parameters), **more, "release": command.release or None})
