"""Which devices a profile may be used for, and how it is reported to an agent. Pure."""

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any

from octoform.patterns import regex
from octoform.policy.kinds import describe
from octoform.profiles import match_rule
from octoform.profiles.model import Profile, plain

MAX_LINE, MAX_DEPTH = 100, 3
_PACKAGING = regex(r"\b(?:packages?|librar(?:y|ies)|modules?|imported|installs?|pip|PyPI|SDK|wheels?)\b", re.IGNORECASE)
_PART = regex(r"\n\s*\n|\n(?=[-*] )")
NO_ANSWERS: Mapping[str, str] = MappingProxyType({})


def devices_of(profile: Profile, probe: Any, answers: Mapping[str, str] = NO_ANSWERS) -> frozenset[str]:
    """Ids of the PROBE devices for which the profile's match rule holds; never raises, whatever ``probe`` is.

    The words must be in what PROBE recorded of that very device, or in a person's answer about it. A neighbour
    (``context``) is never met.
    """
    return devices_by(profile.evidence, probe, answers)


def devices_by(rule: match_rule.Rule, probe: Any, answers: Mapping[str, str] = NO_ANSWERS) -> frozenset[str]:
    """The same for a match rule."""
    return frozenset(
        device["id"] for device in attached(probe) if match_rule.holds(rule, device, answers.get(device["id"], ""))
    )


def attached(probe: Any) -> Iterator[Mapping[str, Any]]:
    """The devices that a profile may match: those with an id, without neighbours (``context``)."""
    devices = probe.get("devices") if isinstance(probe, Mapping) else None
    for device in devices if isinstance(devices, list) else ():
        if isinstance(device, Mapping) and isinstance(device.get("id"), str) and device.get("context") is not True:
            yield device


def contributions(
    profiles: Iterable[Profile], probe: Any, answers: Mapping[str, str] = NO_ANSWERS
) -> list[tuple[str, str]]:
    """(device id, profile name) of each device that a profile holds for, in the order of the ids."""
    return sorted((device, profile.name) for profile in profiles for device in devices_of(profile, probe, answers))


def near(
    profiles: Collection[Profile], probe: Any, answers: Mapping[str, str] = NO_ANSWERS
) -> list[tuple[str, str, str]]:
    """(device id, profile name, word) of each device that lacks a word alone, and that no one has spoken of.

    The word is one that a person would have to say; it is taken from the product's name where one is there.
    """
    settled = {device for device, _ in contributions(profiles, probe, answers)} | set(answers)
    return sorted(
        (device["id"], profile.name, min(words, key=lambda word: word.casefold() not in profile.product.casefold()))
        for profile in profiles
        for device in attached(probe)
        if device["id"] not in settled and (words := match_rule.words_wanting(profile.evidence, device))
    )


def commands(profile: Profile) -> tuple[Mapping[str, Any], ...]:
    """The commands of its protocol definition as JSON, none where it has none."""
    return tuple(plain(profile.grammar)["commands"]) if profile.grammar is not None else ()


def definition(profile: Profile) -> Mapping[str, Any]:
    """Its protocol definition as JSON, empty where it has none."""
    return plain(profile.grammar) if profile.grammar is not None else {}


def briefing(profile: Profile, ids: Collection[str]) -> str:
    """The profile as an agent gets it: the devices that it matches, its limits, its prose; no other device.

    What is true of the product and what is true of this one copy stand apart, so that neither is taken for the other.
    """
    lines = [f"Profile {profile.name}: {profile.about}"]
    lines += [f"The product is called: {profile.product}."] if profile.product else []
    lines.append(f"Its match rule matches: {', '.join(sorted(ids))}.")
    rig = profile.rig
    lines += _limits(profile.limits[: len(profile.limits) - len(rig.limits)])
    lines += ["", "The product, every copy of it:", "", profile.body.strip()]
    if profile.grammar is not None:
        lines += [
            "",
            "Its protocol definition; each command becomes exactly one tool of that name, and there is no other:",
        ]
        lines += ["", _laid_out(plain(profile.grammar, of_product=True))]
    own = [*(f"- {fact}" for fact in of_rig(profile)), *_limits(rig.limits)]
    if own:
        lines += ["", "Only this rig, no other copy of the product:", "", *own]
    return "\n".join([*lines, ""])


def packaging(profile: Profile, ids: Collection[str]) -> str:
    """The part of a profile about the packages of a server: its library, its files, and the paragraphs about packages.

    Empty where there is nothing of that kind.
    """
    bank = plain(profile.grammar).get("registers", {}) if profile.grammar is not None else {}
    library, files = bank.get("library"), bank.get("calibration", {}).get("files", ())
    lines = [f"Its library: {library['distribution']}, imported as {library['module']}."] if library else []
    lines += [f"A file that its server reads: {file}" for file in files]
    parts = [part.strip() for part in _PART.split(profile.body) if _PACKAGING.search(part)]
    if not lines and not parts:
        return ""
    head = [f"Profile {profile.name}: {profile.about}", f"Its match rule matches: {', '.join(sorted(ids))}."]
    return "\n".join([*head, *lines, *(f"\n{part}" for part in parts), ""])


def _laid_out(value: Any, depth: int = 1) -> str:
    """JSON with what is short on one line: a whole one would take most of a prompt for its line ends and spaces."""
    flat = json.dumps(value, ensure_ascii=False)
    if len(flat) <= MAX_LINE or not value or depth > MAX_DEPTH or not isinstance(value, Mapping | list):
        return flat
    space = " " * depth
    if isinstance(value, list):
        return "[\n" + ",\n".join(f"{space}{_laid_out(item, MAX_DEPTH + 1)}" for item in value) + "]"
    members = [f"{space}{json.dumps(key)}: {_laid_out(item, depth + 1)}" for key, item in value.items()]
    return "{\n" + ",\n".join(members) + "}"


def of_rig(profile: Profile) -> Iterator[str]:
    """The facts of the owner's own unit beside its limits, each as a sentence."""
    rig = profile.rig
    yield from rig.facts
    for unit, reason in rig.disabled.items():
        yield f"{unit} is disabled: {reason}. It is never moved; a call for it gets the reason."
    for unit, number in rig.units.items():
        yield f"{unit} has the id {number} on the bus."


def _limits(given: Iterable[Mapping[str, Any]]) -> list[str]:
    return [f"Limit: {words}." for item in given for words in describe(item)]


def for_task(profile: Profile, ids: Collection[str]) -> dict[str, Any]:
    """The same for a program: the profile's object in an agent's task."""
    return {
        "name": profile.name,
        "about": profile.about,
        "product": profile.product or profile.about,
        "holds": sorted(ids),
        "limits": [dict(item) for item in profile.limits],
        "grammar": plain(profile.grammar) if profile.grammar is not None else None,
        "body": profile.body,
        "rig": list(profile.rig.facts),
    }
