"""Which classes of the kernel, or of USB, lead to what: one table for names ("a camera") and for capabilities.

A class of the kernel is how Linux itself states what a device is for. A word of these tables therefore follows from a
class, or somebody has to say it: the device in its own strings, or its owner. No product is named here.
"""

import re

from octoform.contracts.model import JsonObject
from octoform.patterns import regex

RAW = frozenset(
    {"tty", "hid", "hidraw", "hiddev", "i2c", "i2c-adapter", "i2c-dev", "spi", "spidev", "usb", "usb_device", "usbmisc"}
)
"""Classes of the kernel whose nodes carry bytes and no meaning (Documentation/ABI, devices.txt)."""

_VISION = "usb-ef-05"  # USB3 Vision: a camera to those who speak its protocol, and bytes to the kernel
_USB_RAW = frozenset({"usb-02", "usb-03", _VISION})
_USB_CLASS = regex(r"\bclass ([0-9a-f]{2})/[0-9a-f]{2}/[0-9a-f]{2}|^interface_class: ([0-9a-f]{2})", re.MULTILINE)
# USB-IF, Defined Class Codes: audio, communications, HID, still image, printer, storage, smart card, video, medical,
# radio, test and measurement; what is vendor specific (ff) or left to each interface (00) shows no way.
_USB_WAYS = frozenset(("01", "02", "03", "06", "07", "08", "0b", "0e", "0f", "e0", "fe"))

_USB_VISION = regex(r"\bclass ef/05/")

_PICTURE = ("video4linux", "usb-0e", "usb-06", _VISION, "media", "dvb", "drm", "graphics")
_SOUND = ("sound", "usb-01", "bluetooth", "dvb", "hdaudio", "soundwire")
_DISK = (
    *("block", "nvme", "usb-08", "mtd", "ubi", "mmc_host", "scsi_device", "scsi_generic", "bsg", "ata_device"),
    *("scsi_host", "scsi_disk", "mmc"),
)
_HEAT = ("hwmon", "iio", "thermal", "power_supply", "nvme", "block", "drm", "w1", "mmc_host", "net", "scsi_generic")
_AIR = ("iio", "hwmon", "input", "w1")
_CHARGE = ("power_supply", "bluetooth")
_KEYS = ("input", "usb-03", "hid", "hidraw")
_PLACE = ("gnss", "wwan", "net", "ptp")

WAYS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("image", "picture", "photo", "snapshot", "frame", "video", "webcam"), _PICTURE),
    **dict.fromkeys(("audio", "sound", "microphone", "speaker", "song", "speech"), _SOUND),
    **dict.fromkeys(("disk", "partition", "partitions", "filesystem", "smart", "storage"), _DISK),
    **dict.fromkeys(("backlight",), ("backlight", "leds", "drm")),
    **dict.fromkeys(("wifi", "wlan"), ("net", "ieee80211", "rfkill")),
}
"""The quantities in capabilities' names, with the classes that measure them; no raw line does."""
MEASURED: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("temperature", "temperatures"), _HEAT),
    **dict.fromkeys(("humidity", "pressure", "illuminance", "acceleration"), _AIR),
    **dict.fromkeys(("co2", "voc", "gas", "air", "dust"), _AIR),
    **dict.fromkeys(("voltage", "voltages"), (*_HEAT, "regulator", "typec", "usb_power_delivery", "powercap")),
    **dict.fromkeys(("battery", "charge"), _CHARGE),
    **dict.fromkeys(("fan", "fans"), ("hwmon", "thermal", "drm", "cooling")),
    **dict.fromkeys(("gps", "gnss", "location"), _PLACE),
    **dict.fromkeys(("key", "keys", "keyboard"), _KEYS),
    **dict.fromkeys(("motor", "motors", "servo", "servos", "stepper"), ("pwm", "gpio", "hwmon")),
    **dict.fromkeys(("joint", "joints", "arm", "gripper", "robot", "rail", "gantry", "valve"), ()),
}
"""The same for what a device behind a raw line may measure as well."""
_MOVED = frozenset(
    {"motor", "motors", "servo", "servos", "stepper", "joint", "joints", "arm", "gripper", "robot", "rail"}
)
_MOVED |= {"gantry", "valve"}
_CHANNELS = {"temperature": "temp", "temperatures": "temp", "humidity": "humidity", "pressure": "pressure"}
_CHANNELS |= dict.fromkeys(("co2", "voc", "gas", "air", "dust"), "(?:mass)?concentration|resistance|gas|co2")
_CHANNELS |= {"voltage": "in$|voltage|vdd", "voltages": "in$|voltage|vdd"}
_CHANNELS |= {"fan": "fan|pwm", "fans": "fan|pwm", "illuminance": "illuminance|intensity", "acceleration": "accel"}
_CHANNEL = regex(r"(?m)^(?:hwmon|iio)\[\d+\]\.(?:in_)?([a-z_]+)\d*: ")

_POINTER = ("mouse", "touchpad", "trackpad", "trackball", "joystick", "gamepad", "touchscreen", "keyboard", "keypad")
KINDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("camera", "webcam", "cam"), _PICTURE),
    **dict.fromkeys(("microphone", "speaker", "headphone", "headset", "soundcard"), _SOUND),
    **dict.fromkeys(("disk", "disc", "ssd", "hdd"), _DISK),
    **dict.fromkeys(_POINTER, _KEYS),
    "numpad": _KEYS,
    "thermometer": _HEAT,
    **dict.fromkeys(("hygrometer", "barometer", "accelerometer", "gyroscope", "compass"), _AIR),
    "battery": ("power_supply", "usb-03", "hid", "hidraw", "hiddev"),
    "lamp": ("leds", "backlight"),
    "pump": ("hwmon",),
    "fan": ("hwmon", "thermal", "cooling"),
    "printer": ("usb-07", "printer", "lp"),
    "scanner": ("usb-06", "usb-03", "scsi_generic", "input"),
    "backlight": ("backlight", "leds", "drm"),
    "led": ("leds", "backlight", "gpio"),
    **dict.fromkeys(("gps", "gnss"), _PLACE),
    "modem": ("wwan", "net"),
    **dict.fromkeys(
        (
            *(
                "robot",
                "arm",
                "gripper",
                "rail",
                "gantry",
                "servo",
                "stepper",
                "motor",
                "manipulator",
                "rover",
            ),
            *("drone", "plotter", "turntable", "gimbal", "conveyor", "slider", "engraver", "cnc", "lathe", "valve"),
            *("relay", "heater"),
        ),
        (),
    ),
}
"""Words of a name that say what kind of thing a device is, and the classes from which they follow.

No class of the kernel leads to what moves, switches or weighs: such a word has to be stated by the device or its owner.
"""

CLASSES: dict[str, tuple[str, ...]] = {
    "light": ("leds", "backlight", "drm", "iio", "hwmon", "usb-03", "input"),
    "storage": (
        *(
            *_DISK,
            "usb-06",
            "nvmem",
            "cdrom",
            "md",
            "memstick_host",
            "ata_port",
            "ata_link",
            "sas_host",
            "raid_devices",
        ),
        *("scsi_tape", "tape", "enclosure", "ufs", "fc_host", "iscsi_host"),
    ),
    "bluetooth": ("bluetooth", "usb-e0", "rfkill", "tty"),
    "gpio": ("gpio", "leds", "pwm", "input", "usb-03", "regulator", "reset"),
    "serial": ("tty", "usb-02", "usb-03", "wwan", "gnss", "bluetooth"),
    **dict.fromkeys(
        ("network", "ethernet"), ("net", "ieee80211", "wwan", "usb-02", "usb-e0", "infiniband", "tty", "rfkill")
    ),
}
"""Words for a class alone: part of many a name, where they promise nothing, and as the class of a device a claim."""
SAME_KIND = {"imager": "camera", "imaging": "camera", "webcam": "camera", "cam": "camera", "scan": "scanner"}
SAME_KIND |= {"lte": "modem", "wwan": "modem", "gps": "gnss", "glonass": "gnss", "gnss": "gps"}
"""Words of a device's own strings that say a kind of thing in another word."""
INPUTS = ("mouse", "keyboard", "touchpad", "touchscreen")
INPUT_KINDS = regex(r"(?m)^input\[\d+\]\.kinds: ")
"""Where PROBE records which kinds of input a device sends, no other follows from its class."""


_CAPTURES = regex(r"(?m)^video4linux\[\d+\]\.udev\.ID_V4L_CAPABILITIES: (.*)$")
"""What udev found that a node of a camera can do; a node of metadata can do nothing."""


def visible_kinds(entry: JsonObject) -> frozenset[str]:
    """The kernel's classes of a PROBE device, and the classes of its USB interfaces that have a standard way."""
    raw = str(entry.get("raw_descriptor", ""))
    shows = _CAPTURES.findall(raw)
    silent = {"video4linux"} if shows and not any("capture" in each or "output" in each for each in shows) else set()
    found = {f"usb-{code}" for code in {"".join(pair) for pair in _USB_CLASS.findall(raw)} & _USB_WAYS}
    return (
        (frozenset(entry.get("classes", ())) - silent) | found | ({_VISION} if _USB_VISION.search(raw) else frozenset())
    )


def is_blank(entry: JsonObject) -> bool:
    """Whether nothing of a device shows more than its class."""
    lines = str(entry.get("raw_descriptor", "")).splitlines()
    return all(line.startswith(("class: ", "bus: ", "name: hwmon")) for line in lines)


def measures(entry: JsonObject, word: str) -> bool:
    """Whether a device may measure what a word names, by its class and the channels that PROBE shows of it."""
    text = str(entry.get("raw_descriptor", ""))
    if word in _MOVED and _MOVED.intersection(re.findall("[a-z]{3,}", text.casefold())):
        return True  # it calls itself what moves
    ways = visible_kinds(entry).intersection(MEASURED[word])
    if ways == {"hwmon"} and is_blank(entry):
        return False
    channels = set(_CHANNEL.findall(text)) - {"name", "label"}
    if not ways or word not in _CHANNELS or not channels or ways - {"hwmon", "iio"}:
        return bool(ways)
    return any(re.match(_CHANNELS[word], channel) for channel in channels)


def speaks_bytes(entry: JsonObject) -> bool:
    """Whether nothing but a raw line leads to a device, or nothing at all."""
    return visible_kinds(entry) <= RAW | _USB_RAW
