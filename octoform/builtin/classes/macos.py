"""Devices of macOS's own reports, which name the kind, so that nothing is inferred.

No capability follows: the embedded agent writes tools for Linux's class interfaces, and what macOS offers in their
place has never been tried by it. Such a device is named, and INTERFACE leaves it out with that reason.
"""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.description.class_model import ACTUATOR, BIDIRECTIONAL, INFRASTRUCTURE, SENSOR, Claim, Evidence
from octoform.builtin.description.device_evidence import Device, Fact

_PREFIX = "macos-"
# The report that lists a device -> kind, category, noun.
_REPORTS: Mapping[str, tuple[str, str, str]] = {
    "camera": ("camera", SENSOR, "camera"),
    "gpu": ("gpu", INFRASTRUCTURE, "graphics adapter"),
    "disk": ("storage", INFRASTRUCTURE, "storage device"),
    "net": ("network", INFRASTRUCTURE, "network adapter"),
    "bluetooth": ("bluetooth", INFRASTRUCTURE, "Bluetooth adapter"),
    "power": ("power", INFRASTRUCTURE, "power supply"),
    "printer": ("printer", ACTUATOR, "printer"),
}
_NAMES = ("name", "model")
SYSTEM = "macos"
NO_TOOLS = "seen by macOS, for which the embedded agent writes no tools"


def claim(device: Device) -> Claim | None:
    """A device of a report, or a USB device that a report lists too; nothing on another system."""
    report = device.bus.removeprefix(_PREFIX)
    if report == device.bus:
        # Without the registry a USB device shows no interfaces; the reports still know what macOS made of it.
        report = next((name for name in ("camera", "audio") if name in device.classes and device.of(name)), "")
        facts = device.of(report) if report else []
    else:
        facts = [fact for fact in device.facts if not fact.owner]
    if not facts:
        return None
    if report == "audio":
        return _sound(facts)
    if report not in _REPORTS:
        return None
    kind, category, noun = _REPORTS[report]
    return Claim(kind, category, noun, (_evidence(facts),), names=_names(facts))


def without_tools(device: Device, annotation: dict[str, Any]) -> dict[str, Any]:
    """The annotation of a Mac's device: always without a capability, and with evidence for the reason."""
    mark = device.cite_self(NO_TOOLS).as_json()
    return {**annotation, "capabilities": [], "evidence": [*annotation["evidence"], mark]}


def _sound(facts: list[Fact]) -> Claim:
    ways = {fact.key.partition("_")[0] for fact in facts if fact.key in ("input_channels", "output_channels")}
    kind, category = "audio", BIDIRECTIONAL
    if len(ways) == 1:
        kind, category = ("audio_in", SENSOR) if "input" in ways else ("audio_out", ACTUATOR)
    return Claim(kind, category, "sound device", (_evidence(facts),), names=_names(facts))


def _evidence(facts: list[Fact]) -> Evidence:
    return Evidence(facts[0].line, "a report of macOS lists it as such")


def _names(facts: list[Fact]) -> tuple[tuple[str, str], ...]:
    return tuple((fact.text, fact.line) for key in _NAMES for fact in facts if fact.key == key and fact.text)
