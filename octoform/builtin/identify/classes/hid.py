"""HID devices by their usages: what the report descriptor says that the device is for.

The numbers are usage pages and usages of the USB-IF's HID Usage Tables, which every HID device declares; PROBE lists
them as `page/usage`. Vendors' own pages (ff00 and above) say nothing.
"""

from octoform.builtin.identify.evidence import Device, Fact
from octoform.builtin.identify.verdict import ACTUATOR, INFRASTRUCTURE, SENSOR, Claim, Evidence

# The functions that are no input device, in the order in which they decide.
_FUNCTIONS = {
    "0084": ("ups", INFRASTRUCTURE, "uninterruptible power supply"),
    "f1d0": ("security", INFRASTRUCTURE, "security token"),
    "0059": ("light", ACTUATOR, "light"),
    "008c": ("barcode", SENSOR, "barcode scanner"),
    "008d": ("scale", SENSOR, "weighing scale"),
    "0020": ("sensor_hub", SENSOR, "sensor hub"),
    "008e": ("card_reader", SENSOR, "magnetic stripe reader"),
}
_LAMPS, _SENSORS = "0059", "0020"
# Lamps below keys are those of a keyboard or a mouse.
_TYPED = ("0001/0006", "0001/0002")
_INPUTS = {
    "000d/0001": ("tablet", "pen tablet"),
    "000d/0002": ("tablet", "pen tablet"),
    "000d/0004": ("touchscreen", "touchscreen"),
    "000d/0005": ("touchpad", "touchpad"),
    "0001/0005": ("gamepad", "game controller"),
    "0001/0004": ("gamepad", "game controller"),
    "0001/0006": ("keyboard", "keyboard"),
    "0001/0002": ("mouse", "mouse"),
}


def claim(device: Device) -> Claim | None:
    """A HID device whose usages name a function that is not input; nothing otherwise."""
    facts = _usages(device)
    typed = any(usage in fact.text.split(",") for fact in facts for usage in _TYPED)
    for fact in facts:
        pages = [usage.partition("/")[0] for usage in fact.text.split(",")]
        for page, entry in _FUNCTIONS.items():
            if page in pages and not (typed and page == _LAMPS) and not (page == _SENSORS and "iio" in device.classes):
                return Claim(*entry, evidence=(Evidence(fact.line, "HID usage page of that function"),))
    return None


def _usages(device: Device) -> list[Fact]:
    """The lines with usages: those of the unit's HID devices, or its own where it is one."""
    own = device.fact("usages") if device.bus == "hid" else None
    return [*device.of("hid", "usages"), *([own] if own else [])]


def claim_input(device: Device) -> Claim | None:
    """A HID device without a kernel input device whose usages name an input function; nothing otherwise."""
    facts = _usages(device)
    for usage, (kind, noun) in _INPUTS.items():
        for fact in facts:
            if usage in fact.text.split(","):
                return Claim(kind, SENSOR, noun, (Evidence(fact.line, "HID usage of that function"),),
                             settled=kind != "tablet")  # fmt: skip
    return None


def is_private(device: Device) -> bool:
    """True when the device declares usages and all of them are its vendor's own: they say nothing."""
    usages = [usage for fact in _usages(device) for usage in fact.text.split(",")]
    return bool(usages) and all(usage.startswith("ff") for usage in usages)
