"""Lights of the kernel's classes: display backlights and LEDs.

The lock lights of a keyboard belong to whoever uses the keyboard; they are not offered.
"""

from octoform.builtin.identify.evidence import Device, Fact
from octoform.builtin.identify.verdict import ACTUATE, ACTUATOR, Capability, Claim

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
