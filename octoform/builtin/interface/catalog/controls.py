"""What shines and what switches: backlights, LEDs, and the lines of GPIO controllers."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import (
    FLAG,
    NUMBER,
    TEXT,
    WHOLE,
    Schema,
    listing,
    maybe,
    number,
    one_of,
    record,
)

LIGHT = record("Light", name=TEXT, percent=NUMBER, level=WHOLE, maximum=WHOLE)
LIGHTS = record("Lights", device=TEXT, lights=listing(LIGHT))
LINE = record("Line", offset=WHOLE, name=TEXT, consumer=TEXT, used=FLAG, direction=TEXT, active_low=FLAG)
CHIP = record("Chip", name=TEXT, label=TEXT, lines=listing(LINE))
CHIPS = record("Chips", device=TEXT, chips=listing(CHIP))
LEVEL = record("Level", device=TEXT, chip=WHOLE, line=WHOLE, name=TEXT, level=maybe(WHOLE), used_by=TEXT)
MOST_LINES = 512


def _percent(_: Facts) -> dict[str, Schema]:
    return {"percent": number("brightness in percent; 0 is off", 0, 100)}


def _lamps(facts: Facts) -> dict[str, Schema]:
    names = sorted({str(lamp.get("name") or "") for fact in facts for lamp in fact.get("leds", ())} - {""})
    if not names:
        return {}
    return {"led": one_of("which LED of the device", names)}


def _led(facts: Facts) -> dict[str, Schema]:
    return {**_lamps(facts), **_percent(facts)}


def _line(facts: Facts) -> dict[str, Schema]:
    count = max((int(fact.get("lines") or 0) for fact in facts), default=0) or MOST_LINES
    return {
        "line": _index("offset of the line on its chip", count),
        "chip": {**_index("which of the device's chips", 16), "default": 0},
    }


def _line_state(facts: Facts) -> dict[str, Schema]:
    states = one_of("drive it, or stop driving it", ("high", "low", "input"))
    return {**_line(facts), "state": states}


def _index(description: str, count: int) -> Schema:
    """An index below a count."""
    return {"description": description, "type": "integer", "minimum": 0, "maximum": count - 1}


KINDS = (
    Kind("read_brightness", "Read the brightness of the display backlight in percent.", LIGHTS, 55),
    Kind(
        "set_brightness",
        "Set the brightness of the display backlight, and read it back. Nothing else is changed.",
        LIGHTS,
        70,
        "actuate",
        _percent,
        units={"percent": "%"},
    ),
    Kind("read_led", "Read the brightness in percent of the device's LEDs.", LIGHTS, 45),
    Kind(
        "set_led",
        "Set the brightness of one LED in percent, and read it back. Ends a trigger that drives the LED.",
        LIGHTS,
        70,
        "actuate",
        _led,
        units={"percent": "%"},
    ),
    Kind(
        "read_gpio_lines",
        "List the lines of a GPIO controller: name, direction, user. No line is requested or changed.",
        CHIPS,
        45,
    ),
    Kind(
        "read_gpio_line",
        "Read the level (1 is high) of a line, without changing its direction; null where `used_by` holds the line.",
        LEVEL,
        65,
        parameters=_line,
        smoke={"line": 0},
        units={"line": "lines", "chip": "chips"},
    ),
    Kind(
        "set_gpio_line",
        "Drive a free line of a header or breakout, and read its level back. What is wired to it acts at once. The "
        "line stays so until it is set again or this server ends; then it is let go. Lines in use are refused.",
        LEVEL,
        88,
        "actuate",
        _line_state,
        units={"line": "lines", "chip": "chips"},
    ),
)
