"""What a description of a tool is about: the device and the act of its capability, and no other device or act.

The agent that uses a tool reads its description alone. Where that describes a camera and the tool reads a keyboard,
states that taking a picture turns an arm, or names a product that the device is not, the agent calls the tool for what
it does not do.
"""

import re
from collections.abc import Iterable, Iterator

from octoform.base.escaping import display
from octoform.contracts.device_kinds import KINDS, visible_kinds
from octoform.contracts.model import Artifacts, JsonObject, effects_of
from octoform.contracts.name_clues import is_class_word, is_filler, kind_of
from octoform.patterns import regex

_SENTENCE = regex(r"(?<=[.!?;:])\s+|\n+")
_ASKS = regex(
    r"(?i)\b(?:whether|if|when|while|until|unless|no|not|never|nothing|nobody|none|neither|without|cannot|somebody"
    r"|someone|anybody|people|person|user|hand|who|instead|other than|unlike|beside|besides|as opposed|rather|reports?"
    r"|count(?:s|ed)?|how)\b"
)
"""A sentence with one of these asks, denies or compares."""
_MOVED = regex(
    r"(?i)\b(?:is|are|gets?|being)\s+(?:\w+\s+)?(?:turned|moved|driven|rotated|tilted|panned|steered|swung|lowered|raised"
    r"|positioned)\s+(?:to|by|towards|into|away|around)\b"
    r"|\b(?:it|tool|call|camera|server|which|also|first|then)\s+(?:\w+\s+)?"
    r"(?:turns|moves|drives|rotates|tilts|pans|steers|swings|lowers|raises)\s+(?:the|an?|its|each|every)\b"
)
_BEGINS = regex(
    r"(?i)^\W*(?:(?:set|write|move|drive|switch|change|adjust|erase|reset|increase|decrease|dim|rotate|open|close"
    r"|enable|disable|start|stop)s?|turns?(?: on| off)?)\s+(?:the|an?|its|one|all|each|every)\b"
)
"""The verb with which a description of a tool that acts begins."""
_STOP_WORDS = """
    a an and are as at be been before by call can device devices each every for from get give given gives has have how
    in into is it its list measure no nor not null of on one only or read reads report reports result return returned
    returns see set show sets state system take than that the them then there these this through to value values was
    wait were what when where whether which while will with without host computer here
"""
_STOP = frozenset(_STOP_WORDS.split())
_RUN = regex(r"[A-Z0-9][\w+/-]*(?:[ ][A-Z0-9][\w+/-]*)+")
_PLAIN_WORDS = "linux python windows macos celsius fahrenheit kelvin hertz ethernet internet bluetooth"
_PLAIN = frozenset(_PLAIN_WORDS.split())
_GENERAL = regex(
    r"(?i)(?:usb|pci|pcie|i2c|spi|pcm|hdmi|dp|vga|sata|ps|ipv?|utf|iso|hid|tpm|mp|m|h|x|v|e?sata|ddr|lpddr|cd|dvd|acpi_?video"
    r"|video4linux|v4l|rs|uart|gpio|hwmon|tty\w*|card|input|event|pc|sd|so|at|k|wifi|bt|cec|ac|bat|adp|cpu|core|eth|wlan)"
    r"[-_]?\d+(?:\.\d+)*|\d+(?:st|nd|rd|th|p|i|k|d|x|bit|mm|cm|hz|khz|mhz|ghz|mb|gb|tb|v|w|a|s|ms|g|fps)|\d+x\d+|[\d.]+"
)
"""What is in the texts of many devices: a bus, a channel, a size, a number."""


def problems(tool: JsonObject, artifacts: Artifacts) -> Iterator[tuple[str, str]]:
    """(what is wrong, the cure) of a tool's description, up to the paragraph for the next stage."""
    text = tool["description"].partition("Through:")[0]
    own = known_text(tool, artifacts)
    if not own:
        return
    if found := _moves(tool, text, artifacts):
        yield (
            f"has {display(found)}, and its capability reads",
            "describe what it reads; what moves acts",
        )
    if other := _another(tool, text, own, artifacts):
        yield f"speaks of {display(other)}, which is another device", "describe the tool's own devices alone"
    elif kind := _another_kind(text, own, _classes(tool, artifacts)):
        yield (
            f"is about a {kind}, which none of its devices is",
            "describe what its capability does, on the devices that have it",
        )
    elif strange := _product(text, own):
        yield (
            f"calls its device {display(strange[0])}, and {display(strange[1])} is in no text of it",
            "name the product as IDENTIFY does",
        )


def _moves(tool: JsonObject, text: str, artifacts: Artifacts) -> str | None:
    """The words by which the description of a reading has something moved; none where the effect is what is wrong."""
    if tool["effect"] != "read" or effects_of(artifacts).get(tool["capability"], "read") != "read":
        return None
    if begun := _BEGINS.search(text):
        return begun[0]
    asked = (sentence for sentence in _SENTENCE.split(text) if not _ASKS.search(sentence))
    return next((found[0] for sentence in asked if (found := _MOVED.search(sentence))), None)


def known_text(tool: JsonObject, artifacts: Artifacts) -> str:
    """All that IDENTIFY and PROBE have of a tool's devices, and of those with its capability, in small letters."""
    owners = (
        device["id"]
        for device in (artifacts.identify or {"devices": []})["devices"]
        if any(each["name"] == tool["capability"] for each in device["capabilities"])
    )
    return "\n".join(_texts([*tool["devices"], *owners], artifacts)).casefold()


def _texts(devices: Iterable[str], artifacts: Artifacts) -> Iterator[str]:
    wanted = {*devices}
    for artifact in (artifacts.identify, artifacts.probe):
        yield from (str(item) for item in (artifact or {}).get("devices", ()) if item["id"] in wanted)
    yield from (
        text for device, text in {**artifacts.answers, **(artifacts.registered or {})}.items() if device in wanted
    )
    for facts in artifacts.profiles.values():
        if facts.holds & wanted:
            yield f"{facts.name} {facts.product} {facts.commands}"


def _another(tool: JsonObject, text: str, own: str, artifacts: Artifacts) -> str | None:
    """The model of another device that a sentence speaks of."""
    plain = [sentence.casefold() for sentence in _SENTENCE.split(text) if not _ASKS.search(sentence)]
    for device in (artifacts.identify or {"devices": []})["devices"]:
        if device["id"] in tool["devices"]:
            continue
        for word in _models(device["identified_as"]):
            if word not in own and any(re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", each) for each in plain):
                return word
    return None


def _models(name: str) -> Iterator[str]:
    """The words of a name that are a model's own: letters and digits in one."""
    for word in re.findall(r"[\w-]{4,}", name.casefold()):
        if re.search(r"\d", word) and re.search(r"[a-z]", word) and not _GENERAL.fullmatch(word):
            yield word


def _classes(tool: JsonObject, artifacts: Artifacts) -> frozenset[str]:
    """The classes of the kernel and of USB that PROBE shows of a tool's devices."""
    probed = (each for each in (artifacts.probe or {}).get("devices", ()) if each["id"] in tool["devices"])
    return frozenset().union(*map(visible_kinds, probed))


def _another_kind(text: str, own: str, classes: frozenset[str]) -> str | None:
    """The kind of thing that a description is about where no word of it is of the devices or their capability."""
    said = [word for word in re.findall(r"[a-z]+", text.casefold()) if word not in _STOP and len(word) > 2]
    kinds = [kind for word in said if (kind := kind_of(word) or (word if word in KINDS else None))]
    shared = any(_stem(word) in own for word in said if not is_filler(word))
    fits = any(classes.intersection(KINDS[kind]) for kind in kinds)
    return kinds[0] if kinds and not shared and not fits else None


def _stem(word: str) -> str:
    return re.sub(r"(?:ies|es|s|ing|ed|y)$", "", word) if len(word) > 4 else word


def _product(text: str, own: str) -> tuple[str, str] | None:
    """A product's name with a word of the device and one that is in no text of it, and that one."""
    for sentence in _SENTENCE.split(text):
        for found in _RUN.finditer(sentence):
            words = found[0].split(" ")
            if found.start() == 0 and words[0].casefold() not in own:
                words = words[1:]  # the verb of the sentence
            spoken = [word for word in words if re.fullmatch(r"[A-Z][a-z]{2,}[A-Za-z]*", word)]
            strange = [word for word in spoken if not _is_known(word, own)]
            makers = [word for word in words if word not in strange and word.casefold() in own and _is_name(word)]
            if strange and makers and words[-1] not in strange[:-1]:
                return " ".join(words), strange[0]
    return None


_SHORT = 4
"""Letters of a word that begins many others: only as a whole word it is one of the device."""


def _is_known(word: str, own: str) -> bool:
    plain = word.casefold()
    if plain in _PLAIN or is_class_word(plain) or is_filler(plain):
        return True
    stem = re.escape(_stem(plain))
    if len(plain) <= _SHORT:
        return re.search(rf"(?<![a-z]){stem}(?![a-z])", own) is not None
    return re.search(rf"(?<![a-z]){stem}|{stem}(?![a-z])", own) is not None


def _is_name(word: str) -> bool:
    plain = word.casefold()
    return len(plain) > 2 and not plain.isdigit() and not is_class_word(plain) and not is_filler(plain)
