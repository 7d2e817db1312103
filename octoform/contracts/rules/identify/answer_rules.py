"""Rules for a person's answers about a device: each counts for its device, none is ignored, and each is asked once.

A profile that holds is of the same kind: who names the device otherwise would do without its protocol definition and
its limits.

A person is asked one question a device. An agent that claims an answer no one gave makes up hardware; one that asks
again, or asks two things at once, has the person do its work.
"""

import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.quantities import unit_in
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.movement_words import is_time, within_answer
from octoform.contracts.name_clues import tokens
from octoform.contracts.name_words import word_set
from octoform.contracts.rules.raw_line_rules import lines_answered, lines_answered_incompletely
from octoform.diagnostics import Diagnostic, error, warning
from octoform.patterns import regex

METHOD = "user_answer"
MAX_QUOTE = 500
# Question marks, also those of Armenian, Greek, Arabic and full-width writing.
_ASKS = regex("[?\u055e\u037e\u061f\u2047\u2048\u2049\uff1f]")


def texts(device: str, artifacts: Artifacts) -> tuple[str, ...]:
    """A person's answer about a device, verbatim and on one line; evidence may quote it."""
    found = artifacts.answers.get(device)
    return (found, " ".join(found.split())) if found is not None else ()


def is_quoted(quote: str, device: JsonObject, artifacts: Artifacts) -> bool:
    """True for a piece, letter by letter, of what PROBE recorded of a device or of a person's answer about it."""
    sources = (device["name"], device["raw_descriptor"], *texts(device["id"], artifacts))
    return any(quote in text for text in sources) and len(re.findall(r"\w", quote)) >= 2


def is_whole_quote(quote: str, device: JsonObject, artifacts: Artifacts) -> bool:
    """True for a quote that neither begins nor ends inside of a word of Latin letters; the longest may be cut."""
    if len(quote) >= MAX_QUOTE:
        return True
    sources = (device["name"], device["raw_descriptor"], *texts(device["id"], artifacts))
    before = "(?<![A-Za-z0-9])" if quote[0].isascii() and quote[0].isalnum() else ""
    behind = "(?![A-Za-z0-9])" if quote[-1].isascii() and quote[-1].isalnum() else ""
    return any(re.search(before + re.escape(quote) + behind, text) for text in sources)


def answer_invented(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Only a device that a person spoke of was identified by an answer."""
    return [
        error(
            "IDENTIFY-ANSWER-INVENTED",
            f"{display(device['id'])} was identified by an answer that no one gave",
            pointer=pointer("devices", index, "method"),
            hint="name the method that decided, or leave the device unknown",
        )
        for index, device in enumerate(value["devices"])
        if device["method"] == METHOD and device["id"] not in artifacts.answers
    ]


def answer_ignored(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A device that a person spoke of is not unknown any more: asking again would be a second question."""
    return [
        error(
            "IDENTIFY-ANSWER-IGNORED",
            f"{display(device['id'])} is unknown although a person answered what it is: "
            f"{display(artifacts.answers[device['id']])}",
            pointer=pointer("devices", index, "category"),
            hint=f"name it from the answer with method {METHOD}, or leave it out with the reason that the answer gives",
        )
        for index, device in enumerate(value["devices"])
        if device["category"] == "unknown" and device["id"] in artifacts.answers
    ]


def profile_ignored(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A device that can do something names the profile that matches it, whose definition and limits bind it."""
    held = {device: name for name, facts in sorted(artifacts.profiles.items()) for device in facts.holds}
    return [
        error(
            "IDENTIFY-PROFILE-IGNORED",
            f"{display(device['id'])} has capabilities, not the profile {display(held[device['id']])} that matches it",
            pointer=pointer("devices", index),
            hint="name it in `profile` and keep to it, or leave the device unknown; an answer stays in `evidence`",
        )
        for index, device in enumerate(value["devices"])
        if device["id"] in held and device["capabilities"] and "profile" not in device
        if device["method"] != "profile"  # which claims one: IDENTIFY-PROFILE-EVIDENCE reports it
    ]


_DENIED = regex(
    r"(?i)(?<!\bdo )(?<!\bdoes )(?<!\bmust )(?<!\bshould )(?<!\bmay )(?<!\bcan )\b(?:not(?! only\b)|no longer|isn't"
    r"|formerly|previously|used to be|instead of|rather than|kein\w*|nicht(?! nur\b))\b[^,.;:!?\n]*"
)
"""A part of an answer that states what a device is not."""


def denied_words(device: str, artifacts: Artifacts) -> frozenset[str]:
    """The words that an answer has only where it states what its device is not, or is no longer."""
    answer = artifacts.answers.get(device, "")
    parts = _DENIED.findall(answer)
    return word_set(parts) - word_set([_DENIED.sub(" ", answer)]) if parts else frozenset()


_NUMBER = regex(r"(?<![\w.,])-?\d+(?:[.,]\d+)?(?![\w-])")
_COUNTS = ["one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve"]
_BOUNDS = frozenset({"range", "ranges", "minimum", "maximum", "min", "max", "limit", "limits", "highest", "lowest"})
_COLOURED = ("colour", "color", "hue", "saturation", "rgb")
_ELECTRIC = ("meter", "multimeter", "supply", "battery", "analyser", "analyzer")
_SPUN = ("fan", "pump", "motor", "stepper", "spindle", "conveyor", "wheel", "mixer", "centrifuge")
_MOVED = (*_SPUN, "arm", "robot", "servo", "rail", "gantry", "stage", "slider", "axis", "joint", "gripper", "valve")
_HEATED = ("heater", "heat", "heating", "oven", "furnace", "kiln", "thermostat", "hotplate")
_QUANTITIES: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(_COLOURED, _COLOURED),
    **dict.fromkeys(
        ("temperature", "temperatures"), ("thermometer", "thermocouple", "celsius", "degc", "degrees", "grad", *_HEATED)
    ),
    **dict.fromkeys(("heater", "heat", "heating"), _HEATED),
    "humidity": ("hygrometer", "moisture", "weather"),
    "pressure": ("barometer", "manometer", "weather", "vacuum"),
    "voltage": (*_ELECTRIC, "voltmeter", "volt", "volts"),
    "current": (*_ELECTRIC, "ammeter", "amp", "amps", "ampere"),
    "weight": ("scale", "scales", "balance"),
    "speed": (*_MOVED, "rpm", "wind", "anemometer", "car", "rover", "drone"),
    **dict.fromkeys(
        ("position", "angle", "joint"), (*_MOVED, "encoder", "gps", "gnss", "gimbal", "turntable", "degrees")
    ),
    **dict.fromkeys(("volume", "loudness"), ("speaker", "amplifier", "audio", "sound", "siren", "music", "pump")),
    **dict.fromkeys(("brightness", "backlight"), ("lamp", "light", "led", "leds", "display", "screen", "dimmer")),
}
"""Quantities in the name of a capability, each with words of an answer from which it follows."""


def answer_stretched(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """What a device on a raw line can do rests on its owner's words: its quantities, its numbers and their units."""
    lines, incomplete, out = lines_answered(value, artifacts), lines_answered_incompletely(value, artifacts), []
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())} if lines else {}
    for index, device in enumerate(value["devices"]):
        answer = lines.get(device["id"])
        if answer is None:
            continue
        entry, says = probed[device["id"]], [each.get("says", "") for each in device["evidence"]]
        own = word_set([answer, str(entry["name"]), str(entry["raw_descriptor"]), *says])
        for at, capability in enumerate(device["capabilities"]):
            if capability["effect"] != "read" and device["id"] in incomplete:
                continue  # IDENTIFY-ACTUATE-WITHOUT-PROFILE reports what the answer lacks
            for place, what in _stretched(capability, answer, own):
                summary = f"{display(capability['name'])} of {display(device['id'])} has {what}, which is not in the "
                summary += f"owner's answer {display(answer)}"
                where = pointer("devices", index, "capabilities", at, *place)
                hint = (
                    "take it from the answer or leave it out; of another language name the word's meaning in `says`; "
                )
                hint += f'for its owner alone: `octoform answer {device["id"]} "..."` records more'
                out.append(error("IDENTIFY-ANSWER-STRETCHED", summary, pointer=where, hint=hint))
    return out


def _stretched(capability: JsonObject, answer: str, own: frozenset[str]) -> Iterator[tuple[tuple[str, ...], str]]:
    """(place, what) of each statement of a capability that goes beyond an answer."""
    acts = capability["effect"] != "read"
    for word in tokens(capability["name"]):
        if word in _QUANTITIES and own.isdisjoint((word, word.removesuffix("s"), *_QUANTITIES[word])):
            yield ("name",), f"the quantity {display(word)}"
            break
    beyond = [each for each in _NUMBER.findall(capability["description"]) if not _is_given(each, answer, own)]
    if acts and beyond:
        yield ("description",), listed(beyond)
    unit = unit_in(_NUMBER.sub("", answer))
    for name, fact in (capability.get("parameters") or {}).items():
        spoken, text = set(tokens(str(name))), str(fact)
        if is_time(str(name)):
            continue
        numbers = _NUMBER.findall(text)
        bounds = len(numbers) > 1 or bool(spoken & _BOUNDS)  # a range, a list, or one end: narrower ones are right
        found = [each for each in numbers if not _is_given(each, answer, own, bounds)]
        if found:
            yield ("parameters", str(name)), f"{listed(found)} as {display(str(name))}"
        elif acts and unit and unit_in(_NUMBER.sub("", text)) not in (None, unit):
            yield ("parameters", str(name)), f"{display(text)} in another unit"


def _is_given(number: str, answer: str, own: frozenset[str], bounds: bool = True) -> bool:
    """Whether an answer has a number, as a figure or a word; a bound may also lie inside of what it allows."""
    plain = number.replace(",", ".")
    value = float(plain)
    spelt = _COUNTS[int(value) - 1] if 1 <= value <= len(_COUNTS) and value.is_integer() else ""
    listed_there = re.search(rf"(?<![\d.,]){re.escape(number.lstrip('-'))}(?![\d]|[.,]\d)", answer) is not None
    return listed_there or number in own or spelt in own or value in (0, 1) or (bounds and within_answer(value, answer))


def many_questions(value: JsonObject, _: Artifacts) -> list[Diagnostic]:
    """A device has at most one question for what is missing."""
    return [
        error(
            "IDENTIFY-MANY-QUESTIONS",
            f"{len(_ASKS.findall(device['missing']))} questions are asked about {display(device['id'])}",
            pointer=pointer("devices", index, "missing"),
            hint="ask the one question whose answer settles what the device is",
        )
        for index, device in enumerate(value["devices"])
        if len(_ASKS.findall(device.get("missing", ""))) > 1
    ]


def line_left_out(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A serial line leads to something that only a person can name, so leaving it out hides the question."""
    lines = {item["id"] for item in (artifacts.probe or {}).get("devices", ()) if _is_line(item)}
    return [
        warning(
            "IDENTIFY-LINE-LEFT-OUT",
            f"{display(item['id'])} has a serial line and is skipped, so no one is asked what is connected to it",
            pointer=pointer("left_out", index),
            hint="add it to devices as unknown, with the one question that would settle it",
        )
        for index, item in enumerate(value["left_out"])
        if item["id"] in lines and item["id"] not in artifacts.answers
    ]


def _is_line(device: JsonObject) -> bool:
    return device["interface"] == "usb" and "tty" in device.get("classes", ()) and device.get("context") is not True


RULES = (
    Rule("IDENTIFY-ANSWER-INVENTED", answer_invented),
    Rule("IDENTIFY-ANSWER-IGNORED", answer_ignored),
    Rule("IDENTIFY-PROFILE-IGNORED", profile_ignored),
    Rule("IDENTIFY-ANSWER-STRETCHED", answer_stretched),
    Rule("IDENTIFY-MANY-QUESTIONS", many_questions),
    Rule("IDENTIFY-LINE-LEFT-OUT", line_left_out),
)


# How much a person had to say before a device could be identified: nothing, its name, or a description of how it works.
#
# The paper's tier 1: the host shows enough. Its second tier: a name. Its third: a description, because
# nothing public describes its use; such a description defines a line protocol. A definition of registers
# behind a public library describes nothing that is not public: the name of the product was enough.

NOTHING, NAME, DESCRIPTION = 1, 2, 3


def tier(annotation: Mapping[str, Any], answers: Collection[str], descriptions: Collection[str]) -> int:
    """The tier of an identified device, by the answers and the profiles that define a line protocol."""
    profile = annotation.get("profile")
    if profile in descriptions:
        return DESCRIPTION
    spoken = annotation["id"] in answers or annotation["method"] == METHOD
    return NAME if spoken or profile is not None else NOTHING


def wanted(annotation: Mapping[str, Any]) -> int | None:
    """The tier of what a person would have to say next, or None where nothing is asked."""
    return NAME if annotation["category"] == "unknown" else None
