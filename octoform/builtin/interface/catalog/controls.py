"""What shines and what switches: backlights, LEDs, and the lines of GPIO controllers (listed, never driven)."""

from octoform.builtin.interface.kinds import Facts, Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, Schema, listing, number, one_of, record

LIGHT = record("Light", name=TEXT, percent=NUMBER, level=WHOLE, maximum=WHOLE)
LIGHTS = record("Lights", device=TEXT, lights=listing(LIGHT))
LINE = record("Line", offset=WHOLE, name=TEXT, consumer=TEXT, used=FLAG, direction=TEXT, active_low=FLAG)
CHIP = record("Chip", name=TEXT, label=TEXT, lines=listing(LINE))
CHIPS = record("Chips", device=TEXT, chips=listing(CHIP))


def _percent(_: Facts) -> dict[str, Schema]:
    return {"percent": number("brightness in percent; 0 is off", 0, 100)}


def _lamps(facts: Facts) -> dict[str, Schema]:
    names = sorted({str(lamp.get("name") or "") for fact in facts for lamp in fact.get("leds", ())} - {""})
    if not names:
        return {}
    return {"led": one_of("which LED of the device", names)}


def _led(facts: Facts) -> dict[str, Schema]:
    return {**_lamps(facts), **_percent(facts)}


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
)
