"""Which items of truth count as onboardable: something that an agent could be given a tool for, on that recording.

In words: a device is onboardable when it senses, acts or does both; when the recording shows a class device of the
kernel for it, bound by a driver, whose interface is standard (a video node, a PCM of a sound card, an input device, a
hwmon or IIO channel, a GPIO chip, a LED, a backlight, a power supply, a thermal zone ...); and when such an interface
serves what the device is for. Everything else is counted under one of the reasons below, which the scorer prints.

* A bare `lsusb -v` shows no class device: nothing is bound that a tool could open.
* A serial line or a raw pipe (tty, hidraw, a CAN bus) carries bytes whose meaning no standard defines. A radio stick
for
  home automation is one: its protocol belongs to its firmware, so it waits for a profile.
* Radio, printing, fingerprints: no class of the kernel receives, prints or recognises. A software radio shows IIO
  buffers of raw samples, but what tunes and gates it is its own driver's.
* A part of a camera pipeline (the kernel shows it as v4l-subdev and makes no video node of it) gives no picture: a
  program has to link it to a receiver first, and no interface of the kernel defines how.
* A class device without a single value (a voltage monitor that only has an alarm, a sound card that is only a mute
  switch and has no PCM) has nothing to read or to play.
"""

import re

from recordings.truth import Device, Item

ACTING = ("sensor", "actuator", "bidirectional")
# Kernel classes whose interface is the same for every device of the class.
_DRIVEN = frozenset(
    (
        "video4linux",
        "sound",
        "input",
        "hwmon",
        "iio",
        "gpio",
        "leds",
        "backlight",
        "power_supply",
        "thermal",
        "rtc",
        "gnss",
    )
)
# What no class of the kernel serves, whatever is bound.
_UNSERVED_TEXT = """
    radio_receive radio_transmit radio_control iq_stream zigbee_radio zigbee_coordinator serial_io serial_read
    serial_write flash_firmware print print_document scan scan_document fingerprint_scan fingerprint_enroll
    verify_fingerprint
"""
_UNSERVED = frozenset(_UNSERVED_TEXT.split())
_VALUES = {
    "hwmon": re.compile(r"(?m)^(?:hwmon\[\d+\]\.)\w+: (?:\S*,)?(?:input|average)\b"),
    "sound": re.compile(r"(?m)^(?:sound\[\d+\]\.)?pcm\w+"),
    "iio": re.compile(r"(?m)^(?:iio\[\d+\]\.)(?:in|out)_\S+: (?:\S*,)?(?:raw|input|processed)\b"),
}

INFRASTRUCTURE = "infrastructure, or unknown to the person who wrote the item"
NOTHING_BOUND = "no class device in the recording (a bare list of USB devices)"
RAW_PIPE = "only a serial line or a raw pipe: no standard tells what its bytes mean"
NO_CLASS_SERVES = "no class of the kernel serves what it is for (radio, printing)"
PART_OF_A_CAMERA = "a part of a camera pipeline, which gives no picture by itself"
NO_VALUE = "a class device without a value that can be read or set"
REASONS = (INFRASTRUCTURE, NOTHING_BOUND, RAW_PIPE, NO_CLASS_SERVES, PART_OF_A_CAMERA, NO_VALUE)


def why_not(item: Item, unit: Device | None) -> str:
    """Why an item is not onboardable, one of REASONS; empty when it is, and for what PROBE does not show."""
    if item.category not in ACTING:
        return INFRASTRUCTURE
    if unit is None:
        return ""
    classes = set(unit.get("classes") or ())
    if not classes:
        return NOTHING_BOUND
    driven = classes & _DRIVEN
    if not driven:
        return RAW_PIPE
    if item.capabilities and _UNSERVED.issuperset(item.capabilities):
        return NO_CLASS_SERVES if driven - {"leds", "input"} else RAW_PIPE
    nodes = [node["name"] for node in unit["instance"]["nodes"] if node["class"] == "video4linux"]
    parts = bool(nodes) and all(name.startswith("v4l-subdev") for name in nodes)
    if driven == {"video4linux"} and parts and _asks_picture(item):
        return PART_OF_A_CAMERA
    if item.kind.startswith("audio") and "sound" in driven:
        driven = {"sound"}  # one unit may hold a sound card beside lights and sensors
    text = "\n".join((str(unit.get("raw_descriptor", "")), *(node["name"] for node in unit["instance"]["nodes"])))
    if driven <= _VALUES.keys() and not any(_VALUES[name].search(text) for name in driven):
        return NO_VALUE
    return ""


def _asks_picture(item: Item) -> bool:
    return not {"capture_image", "capture_frame", "capture_video"}.isdisjoint(item.capabilities)
