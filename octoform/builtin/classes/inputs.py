"""Input devices: keyboards, pointers, touch surfaces, tablets, game controllers, buttons and switches.

What an input device is comes from its event capabilities (PROBE's `kinds`) and from udev's own classification; a USB
or HID device without a kernel input device is identified by its interface class alone.
"""

from collections.abc import Mapping

from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    ACTUATE,
    ACTUATOR,
    INFRASTRUCTURE,
    NUMBER,
    SENSOR,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Evidence,
    Facts,
    Kind,
    Schema,
    listing,
    maybe,
    number,
    record,
    whole,
)
from octoform.builtin.description.device_evidence import Device, Fact

# HID devices by their usages: the purpose that the report descriptor declares.
#
# The numbers are usage pages and usages of the USB-IF's HID Usage Tables, which every HID device declares; PROBE lists
# them as `page/usage`. Vendors' own pages (ff00 and above) say nothing.

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


def claim_hid(device: Device) -> Claim | None:
    """A HID device whose usages name a function that is not input; nothing otherwise."""
    facts = _usages(device)
    typed = any(usage in fact.text.split(",") for fact in facts for usage in _TYPED)
    for fact in facts:
        pages = [usage.partition("/")[0] for usage in fact.text.split(",")]
        for page, entry in _FUNCTIONS.items():
            if page in pages and not (typed and page == _LAMPS) and not (page == _SENSORS and "iio" in device.classes):
                return Claim(*entry, evidence=(Evidence(fact.line, f"HID usage page of that function ({entry[2]})"),))
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


USB_HID = "03"
_CDC_SERIAL = "02/02"
_BOOT = {"03/01/01": ("keyboard", "USB keyboard"), "03/01/02": ("mouse", "USB mouse")}
# Vendor interfaces of game controllers that the kernel's own driver for them is bound by.
# Drivers that bind to every HID device.
_ANY_HID = frozenset(("usb", "usb-generic", "usbhid", "hid-generic", "i2c_hid", "i2c_hid_acpi", "i2c_hid_of"))
_GAME_INTERFACES = ("ff/5d/01", "ff/47/d0")
_ORDER = (
    "accelerometer",
    "tablet",
    "touchscreen",
    "touchpad",
    "gamepad",
    "joystick",
    "keyboard",
    "mouse",
    "switch",
    "buttons",
)
_UDEV = {
    "ID_INPUT_ACCELEROMETER": "accelerometer",
    "ID_INPUT_TABLET": "tablet",
    "ID_INPUT_TOUCHSCREEN": "touchscreen",
    "ID_INPUT_TOUCHPAD": "touchpad",
    "ID_INPUT_JOYSTICK": "gamepad",
    "ID_INPUT_KEYBOARD": "keyboard",
    "ID_INPUT_MOUSE": "mouse",
    "ID_INPUT_SWITCH": "switch",
}
_NOUNS = {"switch": ("input", "switch"), "buttons": ("input", "buttons"), "joystick": ("gamepad", "game controller")}
_VIA = "Linux evdev (/dev/input/eventN)"


def claim_game(device: Device) -> Claim | None:
    """A game controller, which is one whatever else is built in; nothing otherwise."""
    found = claim(device) if device.of("input") else None
    return found if found and found.kind == "gamepad" else None


def claim(device: Device) -> Claim | None:
    """A device that sends input events, or a HID device of another kind; nothing otherwise."""
    groups = [group for group in device.groups("input") if "name" in group and _sends(group)]
    if groups and {"sound", "video4linux"} & device.classes and _only_buttons(groups):
        return None  # jack switches, headset keys and camera buttons: no input device that anyone would ask for
    if groups:
        return _from_events(device, groups)
    found = claim_input(device)
    if found:
        return found
    if shown := _from_boot(device):
        return shown
    if interface := device.usb(*_GAME_INTERFACES):
        evidence = Evidence(interface.line, "game controller interface")
        return Claim("gamepad", SENSOR, "game controller", (evidence,), settled=False)
    interface = device.usb(USB_HID)
    if is_private(device) or device.usb(_CDC_SERIAL):
        return None  # a board with a serial line has a plain HID interface besides
    if (interface or device.bus == "hid") and _has_own_words(device):
        evidence = Evidence(interface.line, "human interface device") if interface else device.cite_self("HID device")
        names = device.names("hid", "name") or _own_name(device)
        noun = "USB input device" if interface else "input device"
        return Claim("input", SENSOR, noun, (evidence,), names=names, settled=False)
    return None


def _has_own_words(device: Device) -> bool:
    """Whether anything but the bare class shows what a HID device is: a word of its own, or a driver of its kind.

    A power supply, a relay and a meter have that class as well as a keyboard has it.
    """
    names = (device.product_text, *(text for text, _ in (*device.names("hid", "name"), *_own_name(device))))
    return any(map(product_names.has_model_name, names)) or not device.drivers <= _ANY_HID


def _from_boot(device: Device) -> Claim | None:
    """A keyboard or a mouse by its boot interfaces; tablets, scanners and tokens show one besides what they are."""
    shown = {_BOOT["/".join(one.triple)]: one for one in reversed(device.interfaces) if "/".join(one.triple) in _BOOT}
    if not shown:
        return None
    leading = _leading(device)
    (kind, noun), interface = next((pair for pair in shown.items() if pair[0][0] == leading), list(shown.items())[-1])
    alone = all("/".join(one.triple) in _BOOT for one in device.interfaces)
    return Claim(kind, SENSOR, noun if alone else "USB input device", (Evidence(interface.line, "USB boot interface"),))


def _from_events(device: Device, groups: list[dict[str, Fact]]) -> Claim:
    found = [(kind, group) for group in groups for kind in _kinds(group)]
    leading = _leading(device)
    found.sort(key=lambda pair: (_ORDER.index(pair[0]) - 2 * (pair[0] == leading), pair[0] != leading))
    kind = found[0][0] if found else "buttons"
    first = found[0][1] if found else groups[0]
    shown, noun = _NOUNS.get(kind, (kind, kind))
    names = tuple((group["name"].text.strip('"'), group["name"].line) for group in [first, *groups])
    evidence = [Evidence(first["name"].line, "the kernel's input device")]
    if "kinds" in first:
        evidence.append(Evidence(first["kinds"].line, f"its events are those of a {noun}"))
    own = (*device.names("hid", "name"), *_own_name(device))
    parameters = {
        "inputs": [
            {"name": group["name"].text.strip('"'), "kinds": _kinds(group)} for group in groups
        ]
    }  # fmt: skip
    # Pen tablets of many brands share their firmware and its strings; only a driver that knows the model settles it.
    # So do game controllers, which also copy the strings of the best known ones.
    settled = kind != "gamepad" and (kind != "tablet" or "wacom" in device.drivers)
    return Claim(shown, SENSOR, noun, tuple(evidence), _capabilities(parameters), (*names, *own), settled)


def _leading(device: Device) -> str:
    """Keyboards with a pointer and mice with keys send both kinds of events; the first boot interface shows which."""
    spoken = set(product_names.words(device.product_text))
    for kind, other in (("keyboard", "mouse"), ("mouse", "keyboard")):
        if kind in spoken and other not in spoken:
            return kind
    for interface in device.interfaces:
        kind = _BOOT.get("/".join(interface.triple), ("", ""))[0]
        if kind:
            return kind
    return ""


def _kinds(group: dict[str, Fact]) -> list[str]:
    lines = group["kinds"].text.split(",") if "kinds" in group else []
    udev = [kind for key, kind in _UDEV.items() if f"udev.{key}" in group]
    return [kind for kind in dict.fromkeys(udev or lines) if kind in _ORDER]


def _sends(group: dict[str, Fact]) -> bool:
    """False for what only takes events, such as the loudspeaker that the kernel drives as an input device."""
    events = set(group["events"].text.split(",")) if "events" in group else {"key"}
    return not events.isdisjoint(("key", "rel", "abs", "switch"))


def _only_buttons(groups: list[dict[str, Fact]]) -> bool:
    return all(kind in ("switch", "buttons") for group in groups for kind in _kinds(group))


def _own_name(device: Device) -> tuple[tuple[str, str], ...]:
    found = device.fact("name") if device.bus in ("hid", "i2c") else None
    return ((found.text, found.line),) if found else ()


def _capabilities(parameters: Mapping[str, object]) -> tuple[Capability, ...]:
    return (
        Capability("read_input_events", "Wait for input events for a bounded time and return them.", _VIA,
                   parameters=parameters),
        Capability("describe_input", "Describe the keys, axes and switches that the device has.", _VIA,
                   parameters=parameters),
    )  # fmt: skip


# Force feedback: motors that let a controller rumble or a phone vibrate. Wheels and sticks are never pushed.

_FORCE_VIA = "Linux evdev force feedback (EVIOCSFF)"


def claim_force(device: Device) -> Claim | None:
    """A game pad that takes force feedback, a vibration motor, or nothing of the kind."""
    for group in device.groups("input"):
        events, kinds = (group[key].text.split(",") if key in group else [] for key in ("events", "kinds"))
        if "force" in events and "gamepad" in kinds:
            evidence = Evidence(group["events"].line, "a game pad that takes force feedback")
            capability = Capability("play_rumble", "Let the controller rumble for a bounded time.", _FORCE_VIA, ACTUATE)
            return Claim("gamepad", SENSOR, "game controller", (evidence,), (capability,))
        if events == ["force"] and "name" in group:
            evidence = Evidence(group["events"].line, "takes force feedback and sends nothing: a vibration motor")
            capability = Capability("play_rumble", "Let the motor vibrate for a bounded time.", _FORCE_VIA, ACTUATE)
            names = ((group["name"].text.strip('"'), group["name"].line),)
            return Claim("haptic", ACTUATOR, "vibration motor", (evidence,), (capability,), names)
        if events == ["sound"] and "name" in group:
            evidence = Evidence(group["events"].line, "takes tones and sends nothing: a beeper")
            names = ((group["name"].text.strip('"'), group["name"].line),)
            return Claim("buzzer", ACTUATOR, "beeper", (evidence,), names=names)
    return None


# Input devices: what they can send, and what they send within a bounded time.

AXIS = record("Axis", code=WHOLE, name=TEXT, minimum=maybe(WHOLE), maximum=maybe(WHOLE), position=maybe(WHOLE))
INPUT = record(
    "Input", name=TEXT, event=TEXT, sends=listing(TEXT), keys=WHOLE, buttons=listing(TEXT), axes=listing(AXIS)
)
INPUTS = record("Inputs", device=TEXT, inputs=listing(INPUT))
EVENT = record("Event", input=TEXT, time_s=NUMBER, type=TEXT, code=WHOLE, value=WHOLE)
EVENTS = record("Events", device=TEXT, waited_s=NUMBER, events=listing(EVENT))
RUMBLED = record("Rumbled", device=TEXT, seconds=NUMBER, strength=NUMBER)


def _waiting(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("longest wait in seconds", 0.1, 60, 5),
        "events": whole("how many events are enough", 1, 200, 20),
    }


def _rumbling(_: Facts) -> dict[str, Schema]:
    return {
        "seconds": number("how long in seconds", 0.05, 5, 0.5),
        "strength": number("strength, as a part of what the device can", 0, 1, 0.5),
    }


KINDS = (
    Kind(
        "describe_input",
        "Describe what the input device sends: kinds of events, keys, buttons, axes with range and present position "
        "(null where this user may not open the device).",
        INPUTS,
        35,
    ),
    Kind(
        "read_input_events",
        "Wait a bounded time for events (keys, axes, switches). An empty list means that none came.",
        EVENTS,
        65,
        parameters=_waiting,
        smoke={"seconds": 0.1},
        units={"seconds": "s", "events": "events"},
    ),
    Kind(
        "play_rumble",
        "Let the game controller or the vibration motor rumble for a bounded time.",
        RUMBLED,
        60,
        "actuate",
        _rumbling,
        units={"seconds": "s", "strength": "of full strength"},
        idempotent=False,
    ),
)
