"""Which cameras a host has, and which of them is used when no one named one.

A camera that shares a hub with what is commanded may vanish just when it is needed, and one that is built into the
machine looks at the person in front of it and not at the bench.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from octoform.contracts.name_clues import same_action
from octoform.contracts.rules.topology_rules import sharing
from octoform.endpoint.client.check import sample_arguments
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.records import dataclass

_CAPTURE = same_action("capture_image")
_FIXED = "removable: fixed"
# What a device on such a bus is plugged into or reached through may be anywhere.
_OUTSIDE = frozenset(("usb", "network", "bluetooth", "firewire", "thunderbolt"))


@dataclass(frozen=True, slots=True)
class Camera:
    """One camera and the call that takes its picture.

    ``hub_shared_with`` are the devices that are commanded (serial boards, actuators) behind a hub of the camera's;
    ``built_in`` states that it is a part of the machine, ``hint`` that the manifest names it.
    """

    device: str
    call: ToolCall
    hub_shared_with: tuple[str, ...] = ()
    built_in: bool = False
    hint: bool = False

    def to_json(self) -> dict[str, Any]:
        """The form in which an agent is notified of it."""
        return {
            "device": self.device,
            "tool": self.call.tool,
            "arguments": dict(self.call.arguments),
            "hub_shared_with": list(self.hub_shared_with),
            "built_in": self.built_in,
            "hint": self.hint,
        }


def cameras(
    probe: Mapping[str, Any],
    identify: Mapping[str, Any],
    interface: Mapping[str, Any],
    hint: str | None = None,
    ledger: Mapping[str, object] | None = None,
) -> tuple[Camera, ...]:
    """Every device with a tool that takes its picture, in the order of ids.

    The first three are accepted artifacts (empty: there is none), ``hint`` the camera that the manifest names.
    ``ledger`` holds the real instances by device id; without it those of ``probe`` count.
    """
    probed = {device["id"]: _placed(device, ledger or {}) for device in probe.get("devices", ())}
    annotated = {device["id"]: device for device in identify.get("devices", ())}
    found = {}
    for tool in interface.get("tools", ()):
        if not _takes_pictures(tool):
            continue
        for device in tool["devices"]:
            arguments = _arguments(tool, device)
            if device in annotated and device not in found and arguments is not None:
                shared = tuple(sorted({other for other, _ in sharing(device, annotated.values(), probed)} - {device}))
                built_in = _is_built_in(probed.get(device, {}))
                found[device] = Camera(device, ToolCall(tool["name"], arguments), shared, built_in, device == hint)
    return tuple(found[device] for device in sorted(found))


def best(found: Iterable[Camera]) -> Camera | None:
    """The camera to look through: the one that the manifest names, else one whose hub is its own, else a USB one."""
    ranked: Sequence[Camera] = sorted(
        found, key=lambda item: (not item.hint, bool(item.hub_shared_with), item.built_in, item.device)
    )
    return ranked[0] if ranked else None


def _placed(device: Mapping[str, Any], ledger: Mapping[str, object]) -> dict[str, Any]:
    """The device with what is known of this very unit."""
    real = ledger.get(device["id"])
    return {**device, "instance": {**(device.get("instance") or {}), **(real if isinstance(real, Mapping) else {})}}


def _takes_pictures(tool: Mapping[str, Any]) -> bool:
    names = (str(tool.get("capability") or ""), str(tool["name"]))
    return tool["effect"] == "read" and any(same_action(name) >= _CAPTURE for name in names)


def _arguments(tool: Mapping[str, Any], device: str) -> dict[str, Any] | None:
    """The fewest arguments that the tool needs to take a picture of this device; None where that is not known.

    A test's arguments are not taken: they are chosen to be quick, and may ask for a picture of a few pixels.
    """
    least = sample_arguments({key: value for key, value in tool.items() if key != "smoke"})
    if least is None:
        given = tool.get("smoke")
        smoke = given.get("arguments", {}) if isinstance(given, Mapping) else {}
        required = tool["input_schema"].get("required", [])
        least = {name: smoke[name] for name in required if name in smoke}
        if len(least) < len(required):
            return None
    several = "device" in tool["input_schema"].get("properties", {})
    return {**least, "device": device} if several else least


def _is_built_in(device: Mapping[str, Any]) -> bool:
    """A camera on an internal bus, or one that the firmware calls fixed, is a part of the machine."""
    if device.get("interface") not in _OUTSIDE:
        return True
    lines = str(device.get("raw_descriptor") or "").splitlines()
    return device["instance"].get("removable") == "fixed" or any(line.strip().endswith(_FIXED) for line in lines)
