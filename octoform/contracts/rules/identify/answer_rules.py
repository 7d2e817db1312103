"""Rules for a person's answers about a device: each counts for its device, none is ignored, and each is asked once.

A profile that holds is of the same kind: who names the device otherwise would do without its protocol definition and
its limits.

A person is asked one question a device. An agent that claims an answer no one gave makes up hardware; one that asks
again, or asks two things at once, has the person do its work.
"""

import re
from collections.abc import Collection, Mapping
from typing import Any

from octoform.base.escaping import display
from octoform.base.pointer import pointer
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.diagnostics import Diagnostic, error, warning

METHOD = "user_answer"
MAX_QUOTE = 500
# Question marks, also those of Armenian, Greek, Arabic and full-width writing.
_ASKS = re.compile("[?\u055e\u037e\u061f\u2047\u2048\u2049\uff1f]")


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
    Rule("IDENTIFY-MANY-QUESTIONS", many_questions),
    Rule("IDENTIFY-LINE-LEFT-OUT", line_left_out),
)


# How much a person had to say before a device could be identified: nothing, its name, or a description of how it works.
#
# The paper's tier 1: the host shows enough. Its second tier: a name. Its third: a description, because
# nothing public describes its use; such a description defines a line protocol. A definition of registers
# behind a public library describes nothing that is not public: the name of the product was enough.

NOTHING, NAME, DESCRIPTION = 1, 2, 3
WORDS = {NOTHING: "no input", NAME: "label", DESCRIPTION: "profile"}


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
