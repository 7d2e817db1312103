"""Rules for the smaller statements of IDENTIFY: the class, the facts among the parameters, the way, an unknown's name.

Each of them goes on to INTERFACE unchanged, and from there to the caller of the tool. So none is filled in from
memory: what a device of that kind usually has, and what it probably is, is no evidence of what this one has and is.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import CLASSES, INPUT_KINDS, INPUTS, KINDS, RAW, SAME_KIND, WAYS
from octoform.contracts.device_kinds import visible_kinds as ways_of
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import destroys, is_class_word, is_filler, kind_of, tokens
from octoform.contracts.name_words import has_digit, is_proper, missing, parts, without_escapes, word_set, words
from octoform.contracts.rules.identify.annotation_rules import capabilities, evidenced
from octoform.contracts.rules.raw_line_rules import known_by_a_person
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

# Facts that a device is asked for at every call, or that are in its descriptor.
_ASKED = regex(
    r"(?:max_|min_|pixel_|image_|video_)?(?:resolutions?|sizes?|fps|frame_?rates?|accuracy|formats?|modes)"
    r"|(?:max(?:imum)?_|min(?:imum)?_)(?:width|height)|(?:design_|full_|nominal_)capacity(?:_\w+)?|capacity_m?[aw]h"
    r"|(?:[xyz]|axis|pressure|tilt|touch|contact)_?(?:range|levels?|min|max|minimum|maximum|resolution|points)"
    r"|(?:max_)?(?:contacts?|touches|touch_?points|fingers)"
)
_NUMBER = regex(r"\d+(?:[.,]\d+)?")
_BY_DEFINITION = regex(r"(?i)%|percent|\b(?:asked|reported|read) (?:at|in) (?:every|each) call")
# Libraries for one kind of line, and the classes of which one leads there.
_LINES: dict[str, tuple[str, ...]] = {
    "pyserial": ("tty",),
    "smbus": ("i2c", "i2c-dev", "i2c-adapter"),
    "smbus2": ("i2c", "i2c-dev", "i2c-adapter"),
    "spidev": ("spi", "spidev"),
    "hidapi": ("hid", "hidraw", "usb-03"),
}
_SHOWN = {"picture", "image", "photo", "photograph", "snapshot"}


def fact_from_memory(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A size, a rate or an accuracy among the parameters is one that PROBE shows, or is asked for at every call."""
    out = []
    for index, at, _, capability, entry in evidenced(value, artifacts):
        own = set(_NUMBER.findall(f"{entry['name']}\n{entry['raw_descriptor']}"))
        for name, fact in _facts(capability.get("parameters", {})):
            unsaid = [each for each in _NUMBER.findall(fact) if each not in own]
            if unsaid and not _BY_DEFINITION.search(fact):
                summary = (
                    f"{display(name)} of {display(capability['name'])} has {listed(unsaid)}, which PROBE shows nowhere"
                )
                where = pointer("devices", index, "capabilities", at, "parameters", name)
                hint = 'write "asked at every call" where the device can be asked; else leave the fact out'
                out.append(error("IDENTIFY-FACT-FROM-MEMORY", summary, pointer=where, hint=hint))
    return out


_COUNTS = ["two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "twelve", "sixteen", "twenty"]
_VALUES = {word: str(number) for word, number in zip(_COUNTS, (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 16, 20), strict=True)}
_FIGURE = regex(
    r"(?i)(?<![\w.,])(\d+(?:[.,]\d+)?)\s?[x\u00d7]\s?(\d+)\b"
    r"|(?<![\w.,])(\d+(?:[.,]\d+)?|" + "|".join(_COUNTS) + r")[\s-]?"
    r"(?:inch(?:es)?|mm|cm|px|pixels?|megapixels?|mp|dpi|fps|[kmg]?hz|[kmgt]i?b(?:it/s)?|mah|wh|watts?|volts?|lumens?|rpm"
    r"|points?|contacts?|fingers?|channels?|cores?|axes|buttons?|levels?|degrees?)\b"
)
"""Amounts in prose: a size, and a number with its unit."""
_SOURCE = regex(r"(?i)https?://|\bwww\.|\b(?:usb|pci|pnp|oui)\.?ids\b|\bhwdb\b|\bdata ?(?:base|sheet)\b")


def figure_from_memory(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """An amount in `says` is one of the device's own text, or has its source beside it."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        entry = probed.get(device["id"])
        if entry is None or known_by_a_person(device, artifacts) or device["method"] == "web_search":
            continue
        own = f"{entry['name']}\n{entry['raw_descriptor']}\n{(artifacts.registered or {}).get(device['id'], '')}"
        numbers = set(re.findall(r"\d+(?:[.,]\d+)?", own))
        for at, evidence in enumerate(device["evidence"]):
            said = evidence.get("says", "")
            figures = (each for found in _FIGURE.findall(said) for each in found if each)
            unsaid = [each for each in figures if _VALUES.get(each.casefold(), each) not in numbers]
            if unsaid and not _SOURCE.search(said):
                summary = f"{display(said)} has {listed(unsaid)}, which PROBE shows nowhere of {display(device['id'])}"
                where = pointer("devices", index, "evidence", at, "says")
                hint = "write what follows from the quote; of another source name the page or the database"
                out.append(error("IDENTIFY-FACT-FROM-MEMORY", summary, pointer=where, hint=hint))
    return out


def from_memory(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """No fact of a parameter and no amount in prose is filled in from memory."""
    return [*fact_from_memory(value, artifacts), *figure_from_memory(value, artifacts)]


_SENSES = frozenset({"video4linux", "usb-0e", "hwmon", "thermal", "iio", "power_supply"})
"""Classes of the kernel of which a reading is what comes out, unless a capability acts."""
_TOUCHED = regex(r"(?m)^input\[\d+\]\.kinds: .*\b(?:touchscreen|touchpad|tablet)\b")
"""Inputs that a hand works on, whatever the device is called."""
_SHINES = frozenset({"leds", "backlight"})
"""Classes of the kernel that only take a value and give back what was set."""
_LEAST_WORDS = 4
"""Of a description that two capabilities do not share by chance."""


def category_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The category is one that the class allows: what only reads is no actuator, and a light senses nothing."""
    if (artifacts.probe or {}).get("platform", {}).get("os") != "linux":
        return []  # other systems have other words for classes
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        entry = probed.get(device["id"])
        if entry is None or entry.get("context") or known_by_a_person(device, artifacts):
            continue
        ways = ways_of(entry)
        right = _right_category(device, ways, bool(_TOUCHED.search(entry["raw_descriptor"])))
        if right is not None:
            shows = f"PROBE shows {listed(sorted(ways))} of it"
            summary = f"{display(device['id'])} is of the category {device['category']}, and {shows}"
            hint = f"write {right}; a capability that acts or reads has to be there for another one"
            out.append(
                error("IDENTIFY-CATEGORY-FALSE", summary, pointer=pointer("devices", index, "category"), hint=hint)
            )
    return out


def _right_category(device: JsonObject, ways: frozenset[str], touched: bool) -> str | None:
    """The category that the classes show where another one is stated; None where they say nothing against it."""
    effects = {capability["effect"] for capability in device["capabilities"]}
    if device["category"] == "actuator" and effects == {"read"} and (ways & _SENSES or touched):
        return "sensor"
    if device["category"] == "sensor" and ways and ways <= _SHINES:
        return "actuator, or bidirectional where what was set is read as well"
    if device["category"] == "infrastructure" and effects and "usb-0e" in ways:
        return "sensor, or bidirectional where it is moved or set as well"
    return None


def description_copied(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A capability must not have the description of another one, of a device of another class."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    first: dict[str, tuple[JsonObject, JsonObject]] = {}
    out = []
    for index, at, device, capability in capabilities(value):
        text = " ".join(capability["description"].casefold().split())
        other, its = first.setdefault(text, (device, capability))
        ways, theirs = (
            ways_of(probed[each["id"]]) if each["id"] in probed else frozenset() for each in (device, other)
        )
        apart = bool(ways and theirs) and ways.isdisjoint(theirs) and capability["name"] != its["name"]
        if apart and len(text.split()) >= _LEAST_WORDS:
            summary = (
                f"{display(capability['name'])} of {display(device['id'])} is described as {display(its['name'])} of "
            )
            summary += f"{display(other['id'])} is"
            where = pointer("devices", index, "capabilities", at, "description")
            hint = "describe what this capability does with this device, by what PROBE shows of it"
            out.append(error("IDENTIFY-DESCRIPTION-COPIED", summary, pointer=where, hint=hint))
    return out


_BY_NAME = frozenset({"descriptor_strings", "id_database", "web_search"})
"""Methods by which a device is known by a name."""
_JOINED = 5
"""Letters of a word of class that counts within another word too (``USBPrinter``); a shorter one may be by chance."""


def _spelt(entry: JsonObject) -> str:
    """All that a device calls itself, as one text."""
    spelt = without_escapes(f"{entry['name']} {entry['raw_descriptor']}", joint="")
    return "".join(spelt.casefold().split())


def class_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The word of class follows from a class of the kernel or of USB, or is a word of the device or its owner."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        word = str(device.get("class", "")).casefold()
        entry, kind = probed.get(device["id"]), word if word in CLASSES else kind_of(word)
        if entry is None or kind is None or known_by_a_person(device, artifacts):
            continue
        found = word_set(
            [str(entry["name"]), str(entry["raw_descriptor"]), (artifacts.registered or {}).get(device["id"], "")]
        )
        found |= word_set([device["identified_as"], *(each.get("says", "") for each in device["evidence"])])
        found |= {SAME_KIND[each] for each in found if each in SAME_KIND}
        found |= {kind} if len(kind) >= _JOINED and kind in _spelt(entry) else set()
        ways = ways_of(entry)
        # Of a device that has a class with a meaning, the raw line beside it means nothing more.
        shown = ways - RAW or (ways if kind in KINDS or "tty" in ways else frozenset())
        other = kind in INPUTS and INPUT_KINDS.search(str(entry["raw_descriptor"]))
        apart = bool(shown) and (shown | (ways & RAW)).isdisjoint((KINDS | CLASSES)[kind])
        # A name in whatever language may bear out such a class, unless it names what the kernel made of the device.
        borne = [each for each in map(kind_of, found) if each and not ways.isdisjoint(KINDS[each])]
        apart = apart and (kind in KINDS or device["method"] not in _BY_NAME or bool(borne))
        if (apart or other) and missing([kind], found | parts(found)):
            summary = (
                f"{display(device['id'])} is of the class {display(kind)}, and PROBE shows {listed(sorted(ways))} of it"
            )
            where = pointer("devices", index, "class")
            hint = "write the kind of thing that its class or its own words name"
            out.append(error("IDENTIFY-CLASS-FALSE", summary, pointer=where, hint=hint))
    return out


def way_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """The way of a capability is named, and leads to the device that has it."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, at, device, capability in capabilities(value):
        where = pointer("devices", index, "capabilities", at)
        ways = ways_of(probed[device["id"]]) if device["id"] in probed else frozenset()
        wrong = [word for word in tokens(capability["via"]) if word in _LINES and ways.isdisjoint(_LINES[word])]
        pictured = _SHOWN & set(tokens(capability["description"].partition(".")[0])) and not _SHOWN & set(
            tokens(capability["name"])
        )
        if known_by_a_person(device, artifacts) or not ways:
            continue
        if wrong or (pictured and ways.isdisjoint(WAYS["picture"])):
            what = display(wrong[0]) if wrong else "a picture"
            summary = (
                f"no class that PROBE shows of {display(device['id'])} leads to {what}; it has {listed(sorted(ways))}"
            )
            hint = "name the way that its class has, and describe what comes back by it"
            out.append(error("IDENTIFY-WAY-FALSE", summary, pointer=where, hint=hint))
    return out


def destruction_understated(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A capability whose effect nothing can undo is irreversible."""
    return [
        error(
            "IDENTIFY-NOT-REVERSIBLE",
            f"{display(capability['name'])} is declared actuate, "
            f"and nothing brings back what {display(verb)} takes away",
            pointer=pointer("devices", index, "capabilities", at, "effect"),
            hint="write irreversible, or name what a second call can undo",
        )
        for index, at, _, capability in capabilities(value)
        if capability["effect"] == "actuate" and (verb := destroys(capability["name"]))
    ]


def guess_under_unknown(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """An unknown device is named by its own words and words of kind, and by no product that it might be."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        entry = probed.get(device["id"])
        if entry is None or device["category"] != "unknown":
            continue
        name = device["identified_as"]
        own = word_set(
            [str(entry["name"]), str(entry["raw_descriptor"]), (artifacts.registered or {}).get(device["id"], "")]
        )
        own |= parts(own)
        telling = [word for word in words(name) if not (is_filler(word.casefold()) or is_class_word(word.casefold()))]
        proper = [
            word
            for word in telling
            if is_proper(word, name) or (word[:1].isupper() and name.startswith(word)) or has_digit(word)
        ]
        spelt = _spelt(entry)
        unsaid = [word for word in missing(proper, own) if word.isascii() and word.casefold() not in spelt]
        unsaid = [word for word in unsaid if word.casefold() not in _ASIDE]
        if unsaid and all(text.isascii() for text in (str(entry["name"]), str(entry["raw_descriptor"]))):
            summary = f"{display(device['id'])} is unknown, and is called {listed(unsaid)}, which is in no string of it"
            where = pointer("devices", index, "identified_as")
            hint = "call it by its own strings, or by its kind of wiring; what it might be belongs in no artifact"
            out.append(error("IDENTIFY-UNKNOWN-NAMED", summary, pointer=where, hint=hint))
    return out


_ASIDE = frozenset({"unknown", "unidentified", "unnamed", "what", "not", "no", "an", "a", "the", "some", "possibly"})
RULES = (
    Rule("IDENTIFY-FACT-FROM-MEMORY", from_memory),
    Rule("IDENTIFY-CATEGORY-FALSE", category_false),
    Rule("IDENTIFY-DESCRIPTION-COPIED", description_copied),
    Rule("IDENTIFY-CLASS-FALSE", class_false),
    Rule("IDENTIFY-WAY-FALSE", way_false),
    Rule("IDENTIFY-NOT-REVERSIBLE", destruction_understated),
    Rule("IDENTIFY-UNKNOWN-NAMED", guess_under_unknown),
)


def _facts(parameters: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """(name, text) of the facts that are asked for or shown, those in lists and tables, too."""
    for name, fact in parameters.items():
        if _ASKED.fullmatch(str(name).casefold()):
            yield str(name), str(fact)
