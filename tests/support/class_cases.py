"""Devices that IDENTIFY puts into a class of another kind, and right classes in unusual words."""

from typing import Any

import identify_cases as identify
from identify_cases import ENV, GPIO, LEDS, LIGHT
from probe_cases import ARM, BATTERY, CAMERA, CHIP, DISK, KESTREL, KEYS, LINE, SOUND, STEPPER, WIFI


def of_class(where: str, device: str, name: str) -> tuple[str, Any]:
    return where, identify.put(device, **{"class": name})


IDENTIFY_WRONG: dict[str, tuple[str, Any]] = {
    f"class: {device} as {name}": of_class(where, device, name)
    for where, device, name in [
        ("laptop", KESTREL, "light"),
        ("laptop", KESTREL, "microphone"),
        ("laptop", BATTERY, "storage"),
        ("laptop", DISK, "camera"),
        ("laptop", WIFI, "bluetooth"),
        ("laptop", SOUND, "keyboard"),
        ("laptop", KEYS, "touchscreen"),
        ("laptop", CHIP, "battery"),
        ("raspberry", ENV, "gpio"),
        ("raspberry", GPIO, "serial"),
        ("bench", STEPPER, "camera"),
        ("rig", CAMERA, "scanner"),
        ("rig bare", ARM, "printer"),
    ]
}
IDENTIFY_RIGHT: dict[str, tuple[str, Any]] = {
    f"class: {device} as {name}": of_class(where, device, name)
    for where, device, name in [
        ("laptop", KESTREL, "webcam"),
        ("laptop", BATTERY, "power"),
        ("laptop", DISK, "disk"),
        ("laptop", WIFI, "network"),
        ("laptop", SOUND, "audio"),
        ("laptop", CHIP, "temperature"),
        ("raspberry", ENV, "environment"),
        ("raspberry", GPIO, "gpio_chip"),
        ("raspberry", LEDS, "light"),
        ("laptop", LIGHT, "light"),
        ("laptop", KEYS, "keyboard"),
        ("laptop", WIFI, "ethernet"),
        ("laptop", KESTREL, "video"),
        ("bench", LINE, "serial"),
    ]
}
