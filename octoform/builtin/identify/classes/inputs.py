"""Input devices: keyboards, pointers, touch surfaces, tablets, game controllers, buttons and switches.

What an input device is comes from its event capabilities (PROBE's `kinds`) and from udev's own classification; a USB
or HID device without a kernel input device is told by its interface class alone.
"""

from collections.abc import Mapping

from octoform.builtin.identify import naming
from octoform.builtin.identify.classes import hid
from octoform.builtin.identify.evidence import Device, Fact
from octoform.builtin.identify.verdict import SENSOR, Capability, Claim, Evidence

USB_HID = "03"
_CDC_SERIAL = "02/02"
_BOOT = {"03/01/01": ("keyboard", "USB keyboard"), "03/01/02": ("mouse", "USB mouse")}
# Vendor interfaces of game controllers that the kernel's own driver for them is bound by.
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
    told = hid.claim_input(device)
    if told:
        return told
    if shown := _from_boot(device):
        return shown
    if interface := device.usb(*_GAME_INTERFACES):
        evidence = Evidence(interface.line, "game controller interface")
        return Claim("gamepad", SENSOR, "game controller", (evidence,), settled=False)
    interface = device.usb(USB_HID)
    if hid.is_private(device) or device.usb(_CDC_SERIAL):
        return None  # a board with a serial line has a plain HID interface besides
    if interface or device.bus == "hid":
        evidence = Evidence(interface.line, "human interface device") if interface else device.cite_self("HID device")
        names = device.names("hid", "name") or _own_name(device)
        noun = "USB input device" if interface else "input device"
        return Claim("input", SENSOR, noun, (evidence,), names=names, settled=False)
    return None


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
    """Keyboards with a pointer and mice with keys send both kinds of events; the first boot interface tells which."""
    spoken = set(naming.words(device.product_text))
    for kind, other in (("keyboard", "mouse"), ("mouse", "keyboard")):
        if kind in spoken and other not in spoken:
            return kind
    for interface in device.interfaces:
        kind = _BOOT.get("/".join(interface.triple), ("", ""))[0]
        if kind:
            return kind
    return ""


def _kinds(group: dict[str, Fact]) -> list[str]:
    told = group["kinds"].text.split(",") if "kinds" in group else []
    udev = [kind for key, kind in _UDEV.items() if f"udev.{key}" in group]
    return [kind for kind in dict.fromkeys(udev or told) if kind in _ORDER]


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
