"""What a description of a tool promises: no part, quantity or accuracy that its devices do not have."""

import re
from collections.abc import Iterator

from octoform.base.escaping import display
from octoform.contracts.device_kinds import speaks_bytes
from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.interface.bound_rules import listed_of
from octoform.contracts.rules.interface.subject_rules import known_text

_PARTS_OF_A_HOST = {
    **dict.fromkeys(("gpu",), ("gpu", "graphic", "drm", "vga", "radeon", "nvidia")),
    **dict.fromkeys(("cpu", "processor"), ("cpu", "processor", "core", "package", "pkg", "tctl", "soc", "k10")),
    **dict.fromkeys(("battery",), ("batter", "power_supply", "pnp0c0a", "ups", "accumulator")),
    **dict.fromkeys(("camera", "webcam"), ("cam", "video", "uvc", "imag", "sensor", "capture")),
    **dict.fromkeys(("backlight",), ("backlight",)),
}
"""Parts that a description may name, each with what a device of that kind has in its strings."""
_QUANTITIES = {
    **{"temperature": "degC", "temperatures": "degC", "humidity": "%", "pressure": "kPa", "voltage": "V"},
    **{"voltages": "V", "illuminance": "lux", "acceleration": "m/s^2"},
}
_NEGATED = re.compile(
    r"\b(?:no|not|nor|neither|never|without|unlike|nothing|only|cannot|except|instead)\b", re.IGNORECASE
)
_ACCURATE = re.compile(
    r"\b(?:accura\w+|precis\w+)\b[^.;\n\d]{0,20}(?:±\s*)?(\d+(?:\.\d+)?)|±\s*(\d+(?:\.\d+)?)", re.IGNORECASE
)


def problems(tool: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, str]]:
    """(what is wrong, the cure) of a tool's description, up to the paragraph for the next stage."""
    probed = {each["id"]: each for each in (artifacts.probe or {}).get("devices", ())}
    if any(speaks_bytes(probed[device]) for device in tool["devices"] if device in probed):
        return  # what is behind a line, PROBE does not show
    texts, units = known_text(tool, artifacts), {row.get("unit") for _, row in listed_of(tool, artifacts)}
    words = tool["description"].partition("Through:")[0]
    first = re.split(r"[.\n]\s", words.strip())[0]
    spoken = set(re.findall(r"[a-z]+", first.casefold())) if not _NEGATED.search(first) else set()
    parts = [each for each in _PARTS_OF_A_HOST.items() if each[0] in spoken]
    found = [word for word, signs in parts if not any(sign in texts for sign in signs)]
    if tool["effect"] == "read" and units and None not in units:
        named = set(tokens(tool["capability"]))
        found += [word for word, unit in _QUANTITIES.items() if word in spoken - named and unit not in units]
    found += [each[0] for each in _ACCURATE.finditer(words) if (each[1] or each[2]) not in texts]
    if found and texts:
        yield f"has {display(found[0])}, and its devices do not", "describe what PROBE and IDENTIFY show of them"
