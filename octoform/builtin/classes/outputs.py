"""Lights of the kernel's classes: display backlights and LEDs.

The lock lights of a keyboard belong to anyone who uses the keyboard; they are not offered.
"""

from octoform.builtin.description.class_model import (
    ACTUATE,
    ACTUATOR,
    BIDIRECTIONAL,
    FLAG,
    INFRASTRUCTURE,
    NUMBER,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Facts,
    Kind,
    Schema,
    listing,
    maybe,
    number,
    one_of,
    record,
)
from octoform.builtin.description.device_evidence import Device, Fact
from octoform.patterns import regex
from octoform.records import replace

_BACKLIGHT = "Linux backlight class (/sys/class/backlight)"
# The lock lights of a keyboard: input3::capslock.
_LOCKS = "input::"
_LEDS = "Linux LED class (/sys/class/leds)"


def claim_backlight(device: Device) -> Claim | None:
    """A display backlight, or nothing of the kind."""
    if "backlight" not in device.classes:
        return None
    lights = [
        {"name": group["name"].text if "name" in group else "", "max_brightness": _number(group, "max_brightness")}
        for group in device.groups("backlight")
    ]
    parameters = {"backlights": lights}
    capabilities = (
        Capability("read_brightness", "Read the brightness of the display's backlight.", _BACKLIGHT,
                   parameters=parameters),
        Capability("set_brightness", "Set the brightness of the display's backlight.", _BACKLIGHT, ACTUATE, parameters),
    )  # fmt: skip
    evidence = (device.cite("backlight", "the kernel's backlight class"),)
    names = tuple((f"display backlight {name}", line) for name, line in device.names("backlight", "name"))
    return Claim("light", ACTUATOR, "display backlight", evidence, capabilities, names)


def claim_leds(device: Device) -> Claim | None:
    """LEDs that software may set, or nothing of the kind."""
    leds = [
        {"name": group["name"].text, "max_brightness": _number(group, "max_brightness")}
        for group in device.groups("leds")
        if "name" in group and not group["name"].text.startswith(_LOCKS)
    ]
    if not leds:
        return None
    parameters = {"leds": leds}
    capabilities = (
        Capability("read_led", "Read the brightness of an LED.", _LEDS, parameters=parameters),
        Capability("set_led", "Set the brightness of an LED.", _LEDS, ACTUATE, parameters),
    )
    evidence = (device.cite("leds", "the kernel's LED class"),)
    names = tuple((f"LED {name}", line) for name, line in device.names("leds", "name"))
    return Claim("light", ACTUATOR, "LED", evidence, capabilities, names)


def _number(group: dict[str, Fact], key: str) -> int | None:
    text = group[key].text if key in group else ""
    return int(text) if text.isdecimal() else None


# Graphics adapters and what is connected to them; monitors name themselves in the EDID that the kernel keeps.

_PCI_DISPLAY = "03"


def claim_display(device: Device) -> Claim | None:
    """A graphics adapter, or nothing of the kind."""
    is_pci = device.pci_class.startswith(_PCI_DISPLAY)
    if device.bus == "virtual" or not (is_pci or {"drm", "graphics"} & device.classes):
        return None
    connectors = [fact.text for fact in device.of("drm", "connector")]
    capabilities: tuple[Capability, ...] = ()
    if connectors:
        capabilities = (
            Capability(
                "read_display",
                "Read which displays are connected, their names and their modes.",
                "Linux DRM (/sys/class/drm)",
                parameters={"connectors": connectors},
            ),
        )
    if is_pci:
        evidence = device.cite_key("class_code", "PCI display controller")
    else:
        evidence = device.cite("drm", "a graphics device of the kernel")
    names = device.names("graphics", "name")
    return Claim("gpu", INFRASTRUCTURE, "graphics adapter", (evidence,), capabilities, names)


# GPIO controllers: the lines of every one can be listed; a line is driven only where people are meant to wire things.
#
# The pins of a processor or a chipset hold power switches, resets and chip selects of the board, so a controller is
# left alone unless something shows that its lines lead out: it is a bridge or expander chip of which nothing else is
# known to hang on (by the kernel's driver), one that the kernel only simulates, or a board whose maker gave lines
# the names of a pin header. The server looks again at the moment of a call.

# The kernel's drivers of chips that have lines and nothing else to do with them.
BREAKOUT_DRIVERS = frozenset(
    (
        *("gpio-sim", "gpio-mockup"),  # the kernel's simulations
        *("cp2112", "mcp2221", "dln2-gpio", "viperboard-gpio"),  # USB bridges
        *("pca953x", "pcf857x", "mcp230xx", "mcp23s08", "max7300", "max7301", "max732x", "74x164", "xra1403"),
    )
)
# What makers of boards call the pins of a header: GPIO17, GPIO-A, P9_22, PIN_7, J8_3, con1-03, [HEADER_10].
HEADER_NAME = (
    r"(?i)\[?(?:GPIO[ _-]?(?:\d{1,3}|[A-L])|P[89]_\d{1,2}",
    r"|(?:\d*PIN|HEADER|CON\d*|\d?J\d+)[ _.-](?:Header Pin)?\d{1,2})\b",
)
_HEADER = regex("".join(HEADER_NAME))
_VIA = "Linux GPIO character device (/dev/gpiochipN)"


def claim_breakout(device: Device) -> Claim | None:
    """A USB bridge whose purpose are its lines, whatever serial line it has besides; nothing otherwise."""
    if device.bus != "usb" or BREAKOUT_DRIVERS.isdisjoint(device.drivers):
        return None
    found = claim_gpio(device)
    return replace(found, noun="GPIO breakout") if found else None


def claim_gpio(device: Device) -> Claim | None:
    """A GPIO controller, or nothing of the kind."""
    if "gpio" not in device.classes and not any(name.startswith("gpiochip") for _, name in device.nodes):
        return None
    labels = [fact.text for fact in device.of("gpio", "label")]
    lines = [int(fact.text) for fact in device.of("gpio", "ngpio") if fact.text.isdecimal()]
    parameters: dict[str, object] = {"labels": labels} if labels else {}
    if lines:
        parameters["lines"] = max(lines)
    names = tuple((f"GPIO controller {label}", line) for label, line in device.names("gpio", "label"))
    evidence = (device.cite("gpio", "the kernel's GPIO class"),)
    return Claim("gpio", BIDIRECTIONAL, "GPIO controller", evidence, _capabilities(device, parameters), names)


def _capabilities(device: Device, parameters: dict[str, object]) -> tuple[Capability, ...]:
    listed = Capability(
        "read_gpio_lines",
        "List the lines of the GPIO controller with name, direction and user, without changing any.",
        _VIA,
        parameters=parameters,
    )
    set_line = Capability(
        "set_gpio_line",
        "Drive one free line of a header or breakout high or low, or make it an input.",
        _VIA,
        ACTUATE,
        parameters,
    )
    read_line = Capability(
        "read_gpio_line",
        "Read the level of one line of a breakout, as it is.",
        _VIA,
        parameters=parameters,
    )
    if not BREAKOUT_DRIVERS.isdisjoint(device.drivers):
        return listed, read_line, set_line
    # Asking for a processor's pin, even to read it, may take it from the function that it is switched to.
    return (listed, set_line) if _has_header(device) else (listed,)


def _has_header(device: Device) -> bool:
    return any(_HEADER.match(name) for fact in device.of("gpio", "line_names") for name in fact.text.split(","))


# What shines and what switches: backlights, LEDs, and the lines of GPIO controllers.

LIGHT = record("Light", name=TEXT, percent=NUMBER, level=WHOLE, maximum=WHOLE)
LIGHTS = record("Lights", device=TEXT, lights=listing(LIGHT))
LINE = record("Line", offset=WHOLE, name=TEXT, consumer=TEXT, used=FLAG, direction=TEXT, active_low=FLAG)
CHIP = record("Chip", name=TEXT, label=TEXT, lines=listing(LINE))
CHIPS = record("Chips", device=TEXT, chips=listing(CHIP))
LEVEL = record("Level", device=TEXT, chip=WHOLE, line=WHOLE, name=TEXT, level=maybe(WHOLE), used_by=TEXT)
MAX_LINES = 512


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
    count = max((int(fact.get("lines") or 0) for fact in facts), default=0) or MAX_LINES
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


# Converters and digital potentiometers of industrial I/O: outputs in volts, amperes and ohms.

OUTPUT = record(
    "Output",
    channel=TEXT,
    value=maybe(NUMBER),
    unit=TEXT,
    minimum=maybe(NUMBER),
    maximum=maybe(NUMBER),
    powered_down=maybe(FLAG),
)
OUTPUTS = record("Outputs", device=TEXT, outputs=listing(OUTPUT))
_VALUE = "in V, out_current in A, out_resistance in ohm"
MAX_VALUE, MAX_OHMS = 50, 1_000_000
"""No converter gives more, in volts or amperes, and no potentiometer; each reports its own maximum."""


def _output(facts: Facts) -> dict[str, Schema]:
    names = sorted(
        {str(name) for fact in facts for name in fact.get("outputs", ())}, key=lambda name: (len(name), name)
    )
    return {
        "channel": one_of("which output", names or ["out_voltage0"]),
        "value": number(_VALUE, -MAX_VALUE, MAX_OHMS if any("resistance" in name for name in names) else MAX_VALUE),
    }


OUTPUT_KINDS = (
    Kind(
        "read_output_channels",
        "Read what each output of the converter is set to, and its range where it has one; null is not reported.",
        OUTPUTS,
        55,
    ),
    Kind(
        "set_output_channel",
        "Set one output of the converter in volts, amperes or ohms, and read it back. What is wired to it acts at "
        "once; it stays so, also when this server ends. A value outside the output's own range is refused.",
        OUTPUTS,
        88,
        "actuate",
        _output,
        units={"value": "V, A or ohm"},
    ),
)
