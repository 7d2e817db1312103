"""Why a device has no tool: what is true of its class, and what is missing, in words for the person who looks for it.

The first half are devices that the kernel could show as one of its classes and did not (no driver is bound, or the
host's record does not show it); the second half are classes that no interface of the system serves.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.identify.classes.macos import NO_TOOLS

_NONE, _CARRIES, _NOTHING, _PART = "no_standard_interface", "bus_infrastructure", "no_function", "out_of_scope"
_NO_INPUT = "the kernel has made no input device of it: no driver is bound to it"
_NO_BUTTONS = "no driver of the kernel or service of the system speaks its own protocol"
_LINK = "carries the host's own network; nothing that an agent should switch"
_CABLE = "a program of its own speaks over its serial line; a profile with its commands would give it tools"
_OTHER = "the kernel offers no class interface for what it does"

_REASONS: Mapping[str, tuple[str, str]] = {
    "accelerometer": (_NONE, "its driver reports only a fall, and offers no channel to read"),
    "audio": (_NONE, "the kernel has made no sound device with a PCM stream of it"),
    "audio_in": (_NONE, "the kernel has made no sound device with a capture stream of it"),
    "audio_out": (_NONE, "the kernel has made no sound device with a playback stream of it"),
    "camera": (_NONE, "the kernel has made no video capture device of it"),
    "camera_sensor": (
        _NONE,
        "gives raw pictures to the machine's camera pipeline, which a program must set up (libcamera)",
    ),
    "dac": (_NONE, "the kernel shows no output channel of it with a scale"),
    "gamepad": (_NONE, _NO_INPUT),
    "gnss": (_NONE, "it shows neither the kernel's gnss device nor a serial port of the USB class (CDC-ACM)"),
    "hwmon": (_NONE, "the kernel shows no channel of it with a reading"),
    "iio": (_NONE, "the kernel shows no channel of it with a reading"),
    "input": (_NONE, f"the kernel has made no input device of it; {_NO_BUTTONS}"),
    "keyboard": (_NONE, _NO_INPUT),
    "light": (_NONE, f"the kernel has made no LED of it; {_NO_BUTTONS}"),
    "mouse": (_NONE, _NO_INPUT),
    "printer": (_NONE, "there is no printer node of the kernel (usblp); printing is the work of a print service"),
    "tablet": (_NONE, _NO_INPUT),
    "touchpad": (_NONE, _NO_INPUT),
    "touchscreen": (_NONE, _NO_INPUT),
    "billboard": (_NOTHING, "only says that a display mode could not be entered"),
    "bluetooth": (_CARRIES, "the radio by itself does nothing; what is paired with it is listed apart"),
    "bridge": (
        _CARRIES,
        "its addresses are never probed: even a read can disturb a chip, and nothing tells what is there",
    ),
    "can": (_NONE, "what its messages mean is not known; nothing is sent on a bus of unknown participants"),
    "codec": (_NONE, "works on memory for other programs, and the kernel shows no node of it"),
    "fingerprint": (
        _NONE,
        "the kernel has no class for it (a service such as fprintd has), and a fingerprint is private",
    ),
    "gpu": (_PART, "draws for the desktop; the kernel shows no connector of it"),
    "hub": (_CARRIES, "carries other USB devices"),
    "instrument": (_NONE, "its commands are not known; a profile with its commands would give it tools"),
    "ir": (_NONE, _NO_BUTTONS),
    "logic": (_NONE, "a program of its own drives it; the kernel has no class for logic analysers"),
    "mcu": (_NOTHING, "waits for firmware and does nothing else"),
    "modem": (_CARRIES, _LINK),
    "network": (_CARRIES, _LINK),
    "optical": (_PART, "holds a medium for the file system; no tool opens its tray or reads discs"),
    "phone": (_NONE, "its files and debug interface need a program of its own and the consent of its owner"),
    "pwm": (_NONE, "its outputs drive parts of the board (a fan, a backlight), and nothing tells which one is free"),
    "nfc": (_NONE, "a service of the system (neard, pcscd) speaks with it; the kernel gives a tool no tags to read"),
    "cec": (_NONE, "its messages switch other people's screens; nothing is sent on a bus of unknown participants"),
    "pps": (_NONE, "gives the moment of a second to the system's clock, and no value"),
    "buzzer": (_NONE, "the kernel plays its tones for the console"),
    "isp": (_NONE, "gives pictures only to a program that has linked the parts of the camera (libcamera)"),
    "vendor": (_NONE, "a program of its own speaks with it; a profile with its commands would give it tools"),
    "video_data": (_NOTHING, "carries numbers about pictures, which the camera has an entry of its own for"),
    "scanner": (_NONE, "scanners are driven by a service of the system (SANE); the kernel has no class for them"),
    "scope": (_NONE, "a program of its own drives it; the kernel has no class for oscilloscopes"),
    "sdr": (_NONE, "its channels are sample streams, which need a radio program"),
    "security": (
        _NONE,
        "needs the smart card service (pcscd) or a library of its own; keys are not handed to an agent",
    ),
    "serial": (_NONE, _CABLE),
    "still_camera": (_NONE, "its pictures are files behind a picture transfer program; the kernel has no class for it"),
    "storage": (_CARRIES, "there is no medium in it that the kernel shows as a disk"),
    "storage_controller": (_CARRIES, "carries drives, which are listed apart"),
    "tpm": (_NONE, "a key store is not handed to an agent"),
    "ups": (_NONE, "the kernel has made no power supply of it; a service (NUT, upower) speaks with it"),
    "wifi": (_CARRIES, _LINK),
    "zigbee": (_NONE, _CABLE),
}

_WORDLESS = "the profile {} has no command grammar to make tools from"
_MEANT = "its meaning is known now; no standard interface drives it: a profile with a grammar would ({})"
_REPORTED = "macos-"
"""How the ids begin of what only the reports of another system list; the reasons above are those of a Linux kernel."""


def why_left_out(device: Mapping[str, Any]) -> tuple[str, str]:
    """(reason, detail) for a device of IDENTIFY that no tool serves."""
    if device["category"] == "unknown":
        return "unknown_meaning", str(device.get("missing") or "")
    if device["id"].startswith(_REPORTED) or any(item.get("says") == NO_TOOLS for item in device.get("evidence", ())):
        return _CARRIES if device["category"] == "infrastructure" else _NONE, NO_TOOLS
    if device["capabilities"]:
        names = ", ".join(capability["name"] for capability in device["capabilities"])
        return _NONE, f"nothing here can write a tool for {names}"
    if "profile" in device and device["category"] != "infrastructure":
        return _NONE, _WORDLESS.format(device["profile"])
    if device.get("method") == "user_answer" and device["category"] != "infrastructure":
        return _NONE, _MEANT.format(f"octoform profile new {device['id']}")
    ordinary = (_CARRIES, "") if device["category"] == "infrastructure" else (_NONE, _OTHER)
    return _REASONS.get(str(device.get("class") or ""), ordinary)
