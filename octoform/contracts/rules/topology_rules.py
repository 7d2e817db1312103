"""Rules for IDENTIFY about where devices are plugged in: a camera and a device that is commanded share no hub.

A camera fills the bandwidth of its hub and draws its power, and when the hub resets, both are gone at once: the arm in
the middle of a move, and the camera that should have shown it. It is a warning, because it works on a quiet bench; and
it is never in an artifact, because the place of a device is no fact about its kind.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.diagnostics import Diagnostic, warning
from octoform.patterns import regex

_USB_PORT = regex(r"\d+-\d+(?:\.\d+)*")
_SERIAL = regex(r"^interface \d+: class 02/02/", re.MULTILINE)
# Actuators that nothing bad happens to when they are late or gone for a second.
_HARMLESS = frozenset(("audio_out", "light", "printer", "monitor"))


def shared_hub(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A camera and a serial line or an actuator hang on the same external hub."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    found = []
    for index, camera in enumerate(value["devices"]):
        for other, hub in sharing(camera["id"], value["devices"], probed) if _is_camera(camera) else ():
            summary = f"the camera {display(camera['id'])} and {display(other)} hang on the same hub, {display(hub)}"
            hint = "plug one of the two into another port of the machine; a busy or failing hub takes both away"
            where = pointer("devices", index)
            found.append(warning("IDENTIFY-SHARED-HUB", summary, pointer=where, hint=hint))
    return found


def sharing(
    camera: str, annotated: Iterable[Mapping[str, Any]], probed: Mapping[str, Mapping[str, Any]]
) -> list[tuple[str, str]]:
    """Commanded devices on an external hub of the camera: each device's id and the id of the hub.

    ``annotated`` are the devices of IDENTIFY, ``probed`` those of PROBE by their id.
    """
    hubs = {_ports(device)[-1]: name for name, device in probed.items() if _ports(device)}
    above = _ports(probed.get(camera, {}))[:-1]
    found = []
    for other in annotated:
        source = probed.get(other["id"], {})
        common = [port for port in _ports(source)[:-1] if port in above]
        if common and _is_commanded(other, source):
            found.append((str(other["id"]), hubs.get(common[-1], "one hub")))
    return found


RULES = (Rule("IDENTIFY-SHARED-HUB", shared_hub),)


def _ports(device: Mapping[str, Any]) -> list[str]:
    """The USB ports on the way to a device, hubs first, its own last; root hubs have none."""
    path = str(device.get("instance", {}).get("sysfs") or "")
    return [part for part in path.split("/") if _USB_PORT.fullmatch(part)]


def _is_camera(annotation: Mapping[str, Any]) -> bool:
    offered = (capability["name"] for capability in annotation["capabilities"])
    return annotation.get("class") == "camera" or "capture_image" in offered


def _is_commanded(annotation: Mapping[str, Any], source: Mapping[str, Any]) -> bool:
    if "tty" in source.get("classes", ()) or _SERIAL.search(source.get("raw_descriptor", "")):
        return True
    return annotation["category"] == "actuator" and annotation.get("class") not in _HARMLESS
