"""Reads the kernel's compact codes: capability bit maps, channel names, EDID blocks.

Numbers are those of the kernel's input-event-codes.h and of the VESA EDID standard, release A.
"""

from collections.abc import Mapping

from octoform.builtin.probe.kernel_text import natural

_EVENT_NAMES = {1: "key", 2: "rel", 3: "abs", 4: "msc", 5: "switch", 17: "led", 18: "sound", 20: "repeat", 21: "force"}
_KEY_ESC, _KEY_D = 1, 32
_BUTTON_MISC, _BUTTON_MOUSE, _BUTTON_JOYSTICK, _BUTTON_GAMEPAD = 0x100, 0x110, 0x120, 0x130
_TOOL_PEN, _TOOL_FINGER, _TOUCH, _BUTTONS_END = 0x140, 0x145, 0x14A, 0x160
_ABS_X, _ABS_Y, _ABS_Z, _ABS_MT_X = 0, 1, 2, 0x35
_PROP_DIRECT, _PROP_ACCELEROMETER = 1, 6
_EDID_HEADER = b"\x00\xff\xff\xff\xff\xff\xff\x00"
_EDID_BLOCK = 128
_EDID_NAME = 0xFC
_HID_LONG_ITEM, _HID_USAGE_PAGE, _HID_USAGE, _HID_COLLECTION, _HID_END_COLLECTION = 0xFE, 0x04, 0x08, 0xA0, 0xC0
_MAX_USAGES = 20
_DESCRIPTORS = (54, 72, 90, 108)


def bitmap(text: str) -> int:
    """The kernel's words of hexadecimal digits, highest first, as one number; 0 when there are none.

    The words are as wide as the recording kernel's ``long``; 64 bits unless the text itself shows otherwise cannot
    be determined, so 64 is taken, which is right for everything below bit 32 on both.
    """
    number = 0
    for word in text.split():
        try:
            number = (number << 64) | int(word, 16)
        except ValueError:
            return 0
    return number


def has(number: int, bit: int) -> bool:
    """Whether a bit is set."""
    return bool(number >> bit & 1)


def event_kinds(events: int) -> str:
    """The kinds of events a device may send or take: ``key,rel,led``."""
    return ",".join(name for bit, name in _EVENT_NAMES.items() if has(events, bit))


def input_kinds(bits: Mapping[str, int]) -> str:
    """The kinds of input by the capability bits: ``keyboard``, ``mouse``, ``buttons`` ..., comma-separated."""
    key, axes = bits["key"], bits["abs"]
    found = [*_key_kinds(key), *_pointer_kinds(key, bits["rel"], axes, bits["prop"])]
    if bits["sw"]:
        found.append("switch")
    return ",".join(found)


def _key_kinds(key: int) -> list[str]:
    if not key:
        return []
    # A keyboard has the whole first row of ordinary keys, from Esc to D.
    full = (1 << (_KEY_D + 1)) - 2
    if key & full == full:
        return ["keyboard"]
    ordinary = key & ((1 << _BUTTON_MISC) - 1) or key >> _BUTTONS_END
    return ["buttons"] if ordinary or (_KEY_ESC and _in_range(key, _BUTTON_MISC, _BUTTON_MOUSE)) else []


def _pointer_kinds(key: int, rel: int, axes: int, prop: int) -> list[str]:
    if has(prop, _PROP_ACCELEROMETER) or (not key and axes & 0b111 == 0b111 and not axes >> _ABS_MT_X):
        return ["accelerometer"]
    if _in_range(key, _BUTTON_JOYSTICK, _TOOL_PEN) and axes:
        return ["gamepad" if has(key, _BUTTON_GAMEPAD) else "joystick"]
    if has(axes, _ABS_X) and has(axes, _ABS_Y):
        return [_surface(key, prop)]
    return ["mouse"] if rel & 0b11 == 0b11 and has(key, _BUTTON_MOUSE) else []


def _surface(key: int, prop: int) -> str:
    if has(key, _TOOL_PEN):
        return "tablet"
    if has(key, _TOOL_FINGER) and not has(prop, _PROP_DIRECT):
        return "touchpad"
    if has(key, _TOUCH) or has(prop, _PROP_DIRECT):
        return "touchscreen"
    return "mouse" if has(key, _BUTTON_MOUSE) else "axes"


def _in_range(number: int, low: int, high: int) -> bool:
    return bool(number >> low & ((1 << (high - low)) - 1))


def channel_order(channel: str) -> tuple[tuple[int, int, str], ...]:
    """Sort key of channel names: ``temp2`` before ``temp10``."""
    return natural(channel)


def edid_names(edid: bytes) -> tuple[str, str]:
    """(three-letter vendor code, product name) of a monitor; empty where the block does not say."""
    if len(edid) < _EDID_BLOCK or edid[:8] != _EDID_HEADER:
        return "", ""
    packed = int.from_bytes(edid[8:10], "big")
    letters = [packed >> shift & 31 for shift in (10, 5, 0)]
    vendor = "".join(chr(64 + letter) for letter in letters) if all(1 <= letter <= 26 for letter in letters) else ""
    for start in _DESCRIPTORS:
        block = edid[start : start + 18]
        if block[:3] == b"\0\0\0" and block[3] == _EDID_NAME:
            return vendor, block[5:].split(b"\n")[0].decode("cp437").strip()
    return vendor, ""


def hid_usages(descriptor: bytes) -> list[str]:
    """The usages (``page/usage``, four hexadecimal digits each) of a HID device's top-level collections, in order.

    The item format is that of the USB Device Class Definition for HID 1.11, section 6.2.2.
    """
    found: list[str] = []
    page = usage = depth = at = 0
    while at < len(descriptor):
        prefix = descriptor[at]
        if prefix == _HID_LONG_ITEM:
            at += 3 + (descriptor[at + 1] if at + 1 < len(descriptor) else 0)
            continue
        size = (0, 1, 2, 4)[prefix & 3]
        data = int.from_bytes(descriptor[at + 1 : at + 1 + size], "little")
        item = prefix & 0xFC
        at += 1 + size
        if item == _HID_USAGE_PAGE:
            page = data
        elif item == _HID_USAGE:
            usage = data
        elif item == _HID_COLLECTION:
            name = f"{usage >> 16 or page:04x}/{usage & 0xFFFF:04x}"
            if depth == 0 and name not in found:
                found.append(name)
            depth += 1
        elif item == _HID_END_COLLECTION:
            depth = max(0, depth - 1)
    return found[:_MAX_USAGES]
