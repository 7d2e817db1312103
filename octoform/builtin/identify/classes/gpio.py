"""GPIO controllers: the lines of every one can be listed; a line is driven only where people are meant to wire things.

The pins of a processor or a chipset hold power switches, resets and chip selects of the board, so a controller is left
alone unless something says that its lines lead out: it is a bridge or expander chip of which nothing else is known to
hang on (told by the kernel's driver), one that the kernel only simulates, or a board whose maker gave lines the names
of a pin header. The server looks again at the moment of a call.
"""

import re
from dataclasses import replace

from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.verdict import ACTUATE, BIDIRECTIONAL, Capability, Claim

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
_HEADER = re.compile("".join(HEADER_NAME))
_VIA = "Linux GPIO character device (/dev/gpiochipN)"


def claim_breakout(device: Device) -> Claim | None:
    """A USB bridge whose purpose are its lines, whatever serial line it has besides; nothing otherwise."""
    if device.bus != "usb" or BREAKOUT_DRIVERS.isdisjoint(device.drivers):
        return None
    found = claim(device)
    return replace(found, noun="GPIO breakout") if found else None


def claim(device: Device) -> Claim | None:
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
