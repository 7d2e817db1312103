"""How good the embedded agent's IDENTIFY is on recorded hosts whose devices people have named.

Right is: seen by PROBE, annotated with a fitting category and a name that shares the product's words, or left unknown
where the recording does not have it. One misidentification is a failure: an agent that acts on a wrong name does harm,
one that answers "unknown" asks a question. Items written by hand are counted apart from items made by rules, because a
program with the same rules agrees with the latter by construction.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from recordings.onboardable import why_not
from recordings.truth import Device, Item

NAMED, UNKNOWN_RIGHT, MISIDENTIFIED = "named", "unknown as should", "misidentified"
MISSED, LEFT_OUT, NOT_SEEN = "not named", "left out", "not seen"
RIGHT = (NAMED, UNKNOWN_RIGHT)
RESULTS = (*RIGHT, MISIDENTIFIED, MISSED, LEFT_OUT, NOT_SEEN)
CERTAIN = 0.5

_WORD = re.compile(r"[a-z]+\d[a-z0-9]*|\d+[a-z][a-z0-9]*|[a-z]+|\d+")
_CAMEL = re.compile(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])")
_NODE_NAME = re.compile(r"^(?:eth|ens|eno|en|wlan|ib|mic|sd[a-z]|sr|vd[a-z]|pmem|nvme\d|mtdblock|gpiochip|card|fd)\w*$")
_ONLY_IDS = re.compile(r"^[0-9a-f]{4} [0-9a-f]{4}$")
_STOP_TEXT = "a an the of for with in on to by or and not no stated as certain its device usb only what is"
_STOP = frozenset(_STOP_TEXT.split())
_CLASS_TEXT = """
    adapter adaptor audio bluetooth bridge bus button camera card chip codec controller digitizer disk dock drive dvd
    ethernet external family fan finger fingerprint flash gigabit gpio graphics hard hd hub input interface internal
    keyboard laser light logic mass memory model modem module monitor mouse multi network node optical oscilloscope pen
    platform port power printer processor radio reader receiver recorded scanner sensor serial slot sound speaker
    storage stick strings switch system tablet temperature touch touchpad touchscreen unknown vendor video virtual
    webcam wired wireless i2c spi pci 2 3 0 1 2.0 3.0 speed full high super built inc ltd co corp corporation company
    technology technologies analog digital converter transmit receive path
    electronics semiconductor international computer systems limited communications
"""
_CLASS_WORDS = frozenset(_CLASS_TEXT.split())
_BY_CLASS = {
    "camera": {"camera", "webcam"},
    "camera_mic": {"camera", "webcam"},
    "storage": {"storage", "disk", "drive", "card", "reader", "flash", "sata", "memory", "ssd"},
    "network": {"network", "ethernet", "lan", "net", "wlan"},
    "audio": {"audio", "sound"},
    "keyboard": {"keyboard"},
    "bridge": {"bus", "bridge", "i2c", "spi"},
    "gpio": {"gpio"},
    "tpm": {"tpm", "trusted"},
}
# Capability names of truth.json that mean the same as a tool of this release.
_SAME = {
    "read_input_events": {
        "input_events", "key_events", "pointer_events", "touch_events", "pen_events", "gamepad_events",
        "stylus_position", "joystick_axes", "button_events", "switch_state",
    },
    "capture_image": {"take_photo", "capture_frame", "video_stream"},
    "record_audio": {"audio_input"},
    "play_audio": {"audio_output"},
    "read_acceleration": {"acceleration"},
    "read_angular_velocity": {"angular_velocity"},
    "read_fan_speed": {"fan_speed"},
    "read_position": {"position_fix", "nmea_stream"},
    "read_sensor_channels": {"read_channel", "read_voltage"},
    "set_output_channel": {"set_voltage", "write_channel"},
    "play_rumble": {"vibrate", "rumble", "haptic"},
    "read_gas": {"read_co2", "read_voc"},
    "read_mass_concentration": {"read_particulates", "read_pm", "read_dust"},
    "read_orientation": {"read_rotation"},
    "set_led": {"led_control", "light_control"},
    "set_brightness": {"light_control"},
    "read_gpio_lines": {"gpio", "gpio_lines", "read_gpio", "gpio_read", "digital_io", "gpio_line_info"},
}  # fmt: skip


@dataclass(frozen=True)
class Mark:
    """One item, how it went and why; ``usable`` is None for what is not onboardable, ``excluded`` has the reason."""

    item: Item
    result: str
    why: str
    usable: bool | None
    excluded: str = ""

    @property
    def asked_unknown(self) -> bool:
        """True where the recording does not identify the product, so that naming one would be a guess."""
        return self.item.identified_by in ("context", "none")


def words(text: str) -> list[str]:
    """Lower-case words of a name, camel case split, digits kept with their letters."""
    return _WORD.findall(_CAMEL.sub(" ", text.replace("_", " ")).lower())


def model_words(text: str) -> set[str]:
    """The words that distinguish one product from another."""
    if _ONLY_IDS.match(text.strip()):
        return set()
    return {w for w in words(text) if w not in _STOP | _CLASS_WORDS and not w.isdigit() and not _NODE_NAME.match(w)}


def mark(item: Item, unit: Device | None, answer: dict[str, Any] | None, tools: Iterable[dict[str, Any]]) -> Mark:
    """Judge one item: ``answer`` is the unit's IDENTIFY annotation, None when it was left out."""
    result, why = _judged(item, unit, answer)
    excluded = why_not(item, unit)
    capabilities = tool_names(tools, unit["id"]) if unit else ()
    return Mark(item, result, why, None if excluded else _serves(item, capabilities), excluded)


def _judged(item: Item, unit: Device | None, answer: dict[str, Any] | None) -> tuple[str, str]:
    if unit is None:
        return NOT_SEEN, "no unit of PROBE holds it"
    if answer is None:
        return LEFT_OUT, f"{unit['id']} is not annotated"
    if wrong := misidentification(item, answer):
        return MISIDENTIFIED, wrong
    shown = f"{unit['id']}: {answer['category']} {answer['identified_as']!r} {answer['confidence']}"
    if item.identified_by in ("context", "none") and answer["confidence"] < CERTAIN:
        return UNKNOWN_RIGHT, shown
    fits = answer["category"] in (item.category, *item.also_ok)
    if fits and answer["category"] == "unknown":
        return UNKNOWN_RIGHT, shown
    return NAMED if fits and same_product(item, answer) else MISSED, shown


def misidentification(item: Item, answer: dict[str, Any]) -> str:
    """Why the annotation is a misidentification; empty when it is none."""
    name, certain = answer["identified_as"], answer["confidence"] >= CERTAIN
    for phrase in item.must_not_be:
        if _says(phrase, answer, item):
            return f"must not be {phrase!r}: {name!r}"
    if item.identified_by in ("context", "none") and certain and answer["category"] != "unknown":
        return f"asserts {name!r} with {answer['confidence']} where the recording does not tell"
    found = model_words(name)
    true = model_words(f"{item.product} {item.quoted}")
    if (
        certain
        and found
        and true
        and not _overlap(found, true)
        and not set(words(name)) & set(words(item.product)) - _STOP
    ):
        return f"another product: {name!r} instead of {item.product!r}"
    return ""


def same_product(item: Item, answer: dict[str, Any]) -> bool:
    """True when the name shares the product's model words, or its class where that is all that can be known."""
    name = answer["identified_as"]
    found, true = set(words(name)) - _STOP, set(words(re.sub(r"\(.*?\)", " ", item.product))) - _STOP
    telling = model_words(item.product)
    if item.identified_by == "strings":
        # The match cites the strings; the product's name is the annotator's paraphrase of them.
        telling |= model_words(item.quoted)
    if _overlap(telling, found) or len(found & true) >= 2:
        return True
    if telling and item.identified_by != "class":
        return False
    kinds = _BY_CLASS.get(item.kind, {item.kind})
    return bool(found & true) or bool(kinds & found) or answer.get("class") == item.kind


def tool_names(tools: Iterable[dict[str, Any]], device_id: str) -> tuple[str, ...]:
    """The capability names that are offered for a device."""
    return tuple(tool["capability"] for tool in tools if device_id in tool["devices"])


def _serves(item: Item, capabilities: Iterable[str]) -> bool:
    """True when one of the tools' capabilities is wanted of the device, by its name or by one that means the same."""
    wanted = set(item.capabilities)
    return any(name in wanted or _SAME.get(name, set()) & wanted for name in capabilities)


def _overlap(some: set[str], others: set[str]) -> bool:
    return any(a == b or (len(a) > 2 and len(b) > 2 and (a in b or b in a)) for a in some for b in others)


def _says(phrase: str, answer: dict[str, Any], item: Item) -> bool:
    """True when the annotation has what the phrase forbids.

    "... as certain" forbids only what is said with confidence; "... by name" and "... by brand" forbid any model or
    brand word that the product's description does not have itself.
    """
    certain = answer["confidence"] >= CERTAIN
    if re.search(r"\bby (?:name|brand)\b|\bnamed vendor\b", phrase):
        return certain and bool(model_words(answer["identified_as"]) - model_words(f"{item.product} {item.quoted}"))
    if "as certain" in phrase and not certain:
        return False
    forbidden = [word for word in words(phrase) if word not in _STOP]
    texts = [answer["identified_as"], *(capability["name"] for capability in answer["capabilities"])]
    return bool(forbidden) and any(set(forbidden) <= set(words(text)) for text in texts)
