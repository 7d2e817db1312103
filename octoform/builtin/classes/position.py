"""Receivers of satellite positions: the kernel's gnss class, and USB receivers that name themselves so.

A receiver sends NMEA sentences by itself, so that reading is enough and nothing is ever sent to it. A USB receiver is
taken only behind the USB class for serial lines (CDC-ACM), where no speed has to be guessed.
"""

from octoform.builtin.description import product_names
from octoform.builtin.description.class_model import (
    NUMBER,
    SENSOR,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Facts,
    Kind,
    Schema,
    maybe,
    number,
    record,
)
from octoform.builtin.description.device_evidence import Device

_CDC_SERIAL = "02/02"
_WORDS = frozenset(("gnss", "gps", "glonass"))
_NETWORK = frozenset(("net", "wwan", "ieee80211"))
_NOUN = "satellite positioning receiver"


def claim(device: Device) -> Claim | None:
    """A receiver whose position can be read, or nothing of the kind."""
    if "gnss" in device.classes:
        evidence, via = device.cite("gnss", "the kernel's GNSS class"), "Linux GNSS class (/dev/gnssN), NMEA 0183"
    elif _names_position(device):
        evidence = device.cite_key("product", "the device's own string names satellite positioning")
        via = "USB CDC-ACM serial line, NMEA 0183 (read only)"
    else:
        return None
    capability = Capability("read_position", "Wait for the receiver's next position and return it.", via)
    return Claim("gnss", SENSOR, _NOUN, (evidence,), (capability,))


def _names_position(device: Device) -> bool:
    spoken = product_names.words(device.product_text)
    serial = device.bus == "usb" and device.usb(_CDC_SERIAL) and "tty" in device.classes
    return bool(serial) and not _WORDS.isdisjoint(spoken) and _NETWORK.isdisjoint(device.classes)


# Satellite positioning receivers: where they say that they are.

POSITION = record(
    "Position",
    device=TEXT,
    fix=TEXT,
    latitude_deg=maybe(NUMBER),
    longitude_deg=maybe(NUMBER),
    altitude_m=maybe(NUMBER),
    satellites=maybe(WHOLE),
    hdop=maybe(NUMBER),
    time_utc=maybe(TEXT),
    sentences=WHOLE,
    waited_s=NUMBER,
)


def _waiting(_: Facts) -> dict[str, Schema]:
    return {"seconds": number("longest wait in seconds", 0.1, 60, 5)}


KINDS = (
    Kind(
        "read_position",
        "Wait for the receiver's next position. `fix` is none, 2d or 3d; without a fix the position is null, and "
        "`sentences` 0 means that the receiver sent nothing that could be read.",
        POSITION,
        75,
        parameters=_waiting,
        smoke={"seconds": 0.5},
        units={"seconds": "s"},
    ),
)
