"""Rules for what a device is said to be able to do: a way that PROBE shows, an effect that the words do not belie.

A capability becomes a tool that somebody calls. So the kernel's classes have to show a way to what it promises (no
picture comes out of a temperature sensor), a verb that destroys is no `read`, and a pipe for bytes is none, whatever
it is called. A person who answered, or a profile that holds, may know of a way that no class shows.
"""

import re
from collections.abc import Iterator

from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.naming import changes, is_passthrough, offers_a_pipe, raw_facts, tokens
from octoform.contracts.raw_line_rules import RAW, known_by_a_person
from octoform.contracts.text import listed, pointer, shown
from octoform.diagnostics import Diagnostic, error

_USB_CLASS = re.compile(r"\bclass ([0-9a-f]{2})/[0-9a-f]{2}/[0-9a-f]{2}|^interface_class: ([0-9a-f]{2})", re.MULTILINE)
# USB-IF, Defined Class Codes: audio, communications, HID, still image, printer, storage, smart card, video, medical,
# radio, test and measurement; what is vendor specific (ff) or left to each interface (00) shows no way.
_USB_WAYS = frozenset(("01", "02", "03", "06", "07", "08", "0b", "0e", "0f", "e0", "fe"))
_PICTURE = ("video4linux", "usb-0e", "usb-06", "media", "dvb", "drm", "graphics")
_SOUND = ("sound", "usb-01", "bluetooth", "dvb")
_DISK = ("block", "nvme", "usb-08", "mtd", "ubi", "mmc_host", "scsi_device", "scsi_generic", "bsg", "ata_device")
_WAYS = {
    **dict.fromkeys(("image", "picture", "photo", "snapshot", "frame", "video", "webcam"), _PICTURE),
    **dict.fromkeys(("audio", "sound", "microphone", "speaker", "song", "speech"), _SOUND),
    **dict.fromkeys(("disk", "partition", "filesystem", "smart", "storage"), _DISK),
    **dict.fromkeys(("backlight",), ("backlight", "leds", "drm")),
    **dict.fromkeys(("wifi", "wlan"), ("net", "ieee80211", "rfkill")),
}
"""What a capability's name speaks of, and the classes of the kernel (or of USB) of which one leads there."""


def without_class(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """PROBE shows a class of the kernel that leads to what the capability promises."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    if (artifacts.probe or {}).get("platform", {}).get("os") != "linux":
        return []
    out = []
    for index, at, device, capability in capabilities(value):
        entry = probed.get(device["id"])
        if entry is None or entry.get("context") or known_by_a_person(device, artifacts):
            continue
        shows = _shown(entry)
        if capability["effect"] != "read" and shows <= RAW:
            continue  # another rule's finding: what acts through a raw line needs a profile
        wanted = [_WAYS[word] for word in tokens(capability["name"]) if word in _WAYS]
        if shows and (shows <= RAW or not wanted or any(shows.intersection(ways) for ways in wanted)):
            continue
        name = shown(capability["name"])
        has = f"it has {listed(sorted(shows))}" if shows else "it has none"
        summary = f"no class that PROBE shows of {shown(device['id'])} leads to {name}; {has}"
        hint = (
            f"{listed(list(dict.fromkeys(way for ways in wanted for way in ways)))} would; leave it out"
            if wanted
            else f"leave it out; `octoform profile new {device['id']}` drafts what a person knows of it"
        )
        where = pointer("devices", index, "capabilities", at)
        out.append(error("IDENTIFY-CAPABILITY-WITHOUT-CLASS", summary, pointer=where, hint=hint))
    return out


def effect_understated(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """What changes or destroys something is no read."""
    return [
        error(
            "IDENTIFY-EFFECT-UNDERSTATED",
            f"{shown(capability['name'])} is declared read, and {shown(verb)} changes something",
            pointer=pointer("devices", index, "capabilities", at, "effect"),
            hint="write irreversible where nothing brings back what was there, else actuate; or name what it reads",
        )
        for index, at, _, capability in capabilities(value)
        if capability["effect"] == "read"
        and not is_passthrough(capability["name"])
        and (verb := changes(capability["name"], capability["description"]))
    ]


def passthrough(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """No capability is a raw pipe to the device, by its name, by its description or by what it takes."""
    out = []
    for index, at, _device, capability in capabilities(value):
        member = "name"
        if not is_passthrough(capability["name"]):
            taken = raw_facts(capability.get("parameters", {}))
            member = "description" if offers_a_pipe(capability["description"]) else "parameters" if taken else ""
        if member:
            summary = f"the capability {shown(capability['name'])} is a raw pipe to the device"
            where = pointer("devices", index, "capabilities", at, member)
            hint = "name what the device does, with typed parameters; a device with no such thing is unknown"
            out.append(error("IDENTIFY-PASSTHROUGH", summary, pointer=where, hint=hint))
    return out


def capabilities(value: JsonObject) -> Iterator[tuple[int, int, JsonObject, JsonObject]]:
    """(device index, capability index, device, capability) of every capability."""
    for index, device in enumerate(value["devices"]):
        for at, capability in enumerate(device["capabilities"]):
            yield index, at, device, capability


def _shown(entry: JsonObject) -> frozenset[str]:
    """The kernel's classes of a device, and the classes of its USB interfaces that have a standard way."""
    found = {"".join(pair) for pair in _USB_CLASS.findall(str(entry.get("raw_descriptor", "")))}
    return frozenset(entry.get("classes", ())) | {f"usb-{code}" for code in found & _USB_WAYS}


RULES = (
    Rule("IDENTIFY-CAPABILITY-WITHOUT-CLASS", without_class),
    Rule("IDENTIFY-EFFECT-UNDERSTATED", effect_understated),
    Rule("IDENTIFY-PASSTHROUGH", passthrough),
)
