"""Rules for IDENTIFY about the facts that it hands on: channels, counts, readings and the ranges of a profile.

INTERFACE and SERVE see no PROBE. They believe a channel that is not there, fewer lines than there are and a range that
is wider than the profile's, so each of these is held against what PROBE shows and the profile has.
"""

import re
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.base.escaping import display, listed
from octoform.base.quantities import unit_of_text
from octoform.base.shape import pointer
from octoform.contracts.model import Artifacts, JsonObject, ProfileFacts, Rule
from octoform.contracts.movement_words import names_unit, unknown_units
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.identify.annotation_rules import capabilities, evidenced
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

_CHANNEL = regex(r"(?:in|out)_[a-z]+\w*|(?:temp|fan|in|curr|power|humidity|pwm)\d+")
_SHOWN = regex(r"(?m)^(?:hwmon|iio)\[\d+\]\.(\w+): ")
_COUNTED = regex(r"(?:n?lines?|line_count|num_lines|ngpio|n_?gpios?|max_brightness|max_state)")
_OF_A_LIGHT = regex(r"(?:brightness_)?(?:range|levels|steps|maximum|max)")
_ASKED = regex(r"(?:sample_?)?rates?(?:_hz)?|sampling_rates?|bit_?depths?|sample_formats?")
_PARTS = regex(r"fans|leds|labels|sensors|zones|lights|backlights|rails|connectors|readings|kinds")
_LABELLED = regex(r"(?m)^(?:hwmon|iio)\[\d+\]\.(\w+): .*?label=(.+)$")
_NESTED = regex(r"ngpio|max_brightness|max_state")
_UNITS = (
    (regex(r"(?:in_|out_)?temp"), frozenset({"degC", "degF", "K"})),
    (regex(r"(?:in_)?humidity"), frozenset({"%"})),
    (regex(r"in_pressure"), frozenset({"kPa", "hPa"})),
    (regex(r"fan\d"), frozenset({"rpm", "%"})),
    (regex(r"in\d|(?:in|out)_voltage"), frozenset({"V"})),
    (regex(r"curr\d|(?:in|out)_current"), frozenset({"A"})),
    (regex(r"power\d"), frozenset({"W"})),
    (regex(r"in_illuminance"), frozenset({"lux"})),
    (regex(r"in_accel"), frozenset({"m/s^2"})),
    (regex(r"in_anglvel"), frozenset({"rad/s"})),
)
"""How the names of the kernel's channels begin (ABI/testing/sysfs-class-hwmon, sysfs-bus-iio), with their units."""
_TINTS = frozenset({"colour", "colours", "color", "colors", "hue", "saturation", "rgb"})
_TINTED = regex(r"(?i)rgb|colou?r|(?:^|[:_\W])(?:red|green|blue|white|amber|multi)")
_DEEP = regex(r"(?i)depth|stereo|tof|lidar|3d|rgbd")
_NUMBER = regex(r"\d+(?:[.,]\d+)?")
_BY_DEFINITION = regex(r"(?i)%|percent|\b(?:asked|reported|read) (?:at|in) (?:every|each) call")
_READINGS = regex(r"(?m)^power_supply\[\d+\]\.readings: (.+)$")
_SUPPLIED = {"temperature": "temp", "current": "current_", "voltage": "voltage_"}
"""Quantities of a power supply, each with how its attributes begin (ABI/testing/sysfs-class-power)."""


def fact_differs(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A channel, a count and a reading among the facts is one that PROBE shows of the device."""
    out = []
    for index, at, device, capability, entry in evidenced(value, artifacts):
        for place, what, has in _differing(capability, entry):
            summary = f"{display(capability['name'])} of {display(device['id'])} has {what}; PROBE shows {has}"
            where = pointer("devices", index, "capabilities", at, *place)
            hint = "copy channels and counts as PROBE has them; leave out what it does not show"
            out.append(error("IDENTIFY-FACT-DIFFERS", summary, pointer=where, hint=hint))
    return out


def _differing(capability: JsonObject, entry: JsonObject) -> Iterator[tuple[tuple[str, ...], str, str]]:
    raw = f"{entry['name']}\n{entry['raw_descriptor']}"
    shown = set(_SHOWN.findall(raw)) - {"name", "label"}
    numbers, facts = set(_NUMBER.findall(raw)), capability.get("parameters") or {}
    for name in _channels(facts) if shown else ():
        if name not in shown and not any(each.startswith(f"{name}_") for each in shown):
            yield ("parameters",), f"the channel {display(name)}", listed(sorted(shown))
    for name, fact in facts.items():
        of_light = "max_brightness" in raw and _OF_A_LIGHT.fullmatch(name)
        counted = _COUNTED.fullmatch(name) and isinstance(fact, int | str)
        asked = _ASKED.fullmatch(name) and "sound" in entry.get("classes", ())
        unsaid = [each for each in _NUMBER.findall(str(fact)) if each not in numbers | {"0", "1"}]
        if (of_light or counted or asked) and unsaid and not _BY_DEFINITION.search(str(fact)):
            yield ("parameters", name), f"{listed(unsaid)} as {display(name)}", "no such number"
    yield from _rows_differing(facts, raw, numbers)
    yield from _unshown(capability, entry, raw)
    for name in (each for each in facts if _PARTS.fullmatch(each) and isinstance(facts[each], list)):
        strange = [each for each in facts[name] if isinstance(each, str) and each.casefold() not in raw.casefold()]
        if strange:
            yield ("parameters", name), f"{listed(strange)} among its {name}", "none of that name"
    readings = [each.strip() for line in _READINGS.findall(raw) for each in line.split(",")]
    alone = {*entry.get("classes", ())} <= {"power_supply"} and bool(readings)
    for word in {*tokens(capability["name"])} & _SUPPLIED.keys() if alone else ():
        if not any(each.startswith(_SUPPLIED[word]) for each in readings):
            yield ("name",), f"a {word}", listed(readings)


def _unshown(capability: JsonObject, entry: JsonObject, raw: str) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """What a name claims of a light or a camera that only some of them have."""
    spoken, classes = {*tokens(capability["name"])}, {*entry.get("classes", ())}
    if spoken & _TINTS and classes == {"leds"} and not _TINTED.search(raw):
        yield ("name",), "a colour", "a light without one"
    if "depth" in spoken and "video4linux" in classes and not _DEEP.search(raw):
        yield ("name",), "a depth", "a camera without it"


def _rows_differing(
    facts: Mapping[str, Any], raw: str, numbers: set[str]
) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """What a row of a table among the facts has of a part: its bound, its unit, its label, the kinds of its events."""
    labels, text = dict(_LABELLED.findall(raw)), raw.casefold()
    rows = [(name, row) for name, table in facts.items() if isinstance(table, list) for row in table]
    for name, row in rows:
        members = row if isinstance(row, Mapping) else {}
        for key, item in members.items():
            if _NESTED.fullmatch(key) and key in raw and str(item) not in numbers:
                yield ("parameters", name), f"{display(str(item))} as {display(key)}", "no such number"
            strange = [each for each in item if str(each).casefold() not in text] if isinstance(item, list) else []
            if strange and _PARTS.fullmatch(key):
                yield ("parameters", name), f"{listed(strange)} among its {key}", "none of that name"
        channel, unit = str(members.get("channel", "")), unit_of_text(members.get("unit"))
        right = next((units for begins, units in _UNITS if begins.match(channel)), None)
        if unit is not None and right is not None and unit not in right:
            yield ("parameters", name), f"{display(channel)} in {unit}", f"a channel in {' or '.join(sorted(right))}"
        label, shown = str(members.get("label", channel)), labels.get(channel, "")
        if shown and _letters(label) not in (_letters(channel), "") and not _alike(label, shown):
            yield ("parameters", name), f"{display(label)} as label of {display(channel)}", display(shown)


def _alike(label: str, shown: str) -> bool:
    """Whether a label has a word of the one that PROBE shows."""
    return bool({*tokens(label)} & {*tokens(shown)}) or _letters(label) in _letters(shown)


def _letters(text: str) -> str:
    return re.sub(r"[\W_]+", "", text).casefold()


def _channels(facts: Mapping[str, Any]) -> Iterator[str]:
    rows = facts.get("channels")
    for row in rows if isinstance(rows, list) else ():
        name = row.get("channel") if isinstance(row, Mapping) else row
        if isinstance(name, str) and _CHANNEL.fullmatch(name):
            yield name


def profile_widened(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A command's parameters are those of the profile: no range is wider, no unit another."""
    out = []
    for index, at, device, capability in capabilities(value):
        facts = artifacts.profiles.get(device.get("profile", ""))
        commands = facts.commands if facts is not None and device["id"] in facts.holds else ()
        command: Mapping[str, Any] = next((each for each in commands if each["tool"] == capability["name"]), {})
        for name, own in (command.get("parameters") or {}).items():
            given = (capability.get("parameters") or {}).get(name)
            wrong = _wider(given, own) if isinstance(given, Mapping) and isinstance(own, Mapping) else ""
            if wrong:
                summary = f"{display(name)} of {display(capability['name'])} has another {wrong} than the profile "
                summary += display(device["profile"])
                where = pointer("devices", index, "capabilities", at, "parameters", name)
                hint = "copy the parameters of a command from the profile; a range may be narrower"
                out.append(error("IDENTIFY-PROFILE-WIDENED", summary, pointer=where, hint=hint))
        if facts is not None and command:
            out += _beyond(capability, command, facts, pointer("devices", index, "capabilities", at))
    return out


def _beyond(
    capability: JsonObject, command: Mapping[str, Any], facts: ProfileFacts, where: str
) -> Iterator[Diagnostic]:
    """The findings for numbers and units in the prose of a command that its profile does not have."""
    for member in ("description", "via"):
        text = str(capability[member])
        if text == command.get("about"):
            continue  # it is the profile's own
        numbers = _FREE_NUMBER.findall(text) if facts.grammar or member == "description" else []
        known = f"{command} {facts.limits} {facts.grammar} {facts.product}" if numbers or names_unit(text) else ""
        own = set(_NUMBER.findall(known))
        if strange := [*(each for each in numbers if each not in own), *unknown_units(text, known)]:
            summary = f"the {member} of {display(capability['name'])} has {listed(strange)}, which its profile has not"
            hint = "describe a command as the profile does, with its numbers and its units"
            yield error("IDENTIFY-PROFILE-WIDENED", summary, pointer=f"{where}/{member}", hint=hint)


_FREE_NUMBER = regex(r"(?<![\w.,])\d+(?:[.,]\d+)?(?![\w])")


def _wider(given: Mapping[str, Any], own: Mapping[str, Any]) -> str:
    """The member in which a parameter goes beyond that of the profile; "" for none."""
    for name, beyond in (("minimum", -1), ("maximum", 1)):
        mine, its = given.get(name), own.get(name)
        if isinstance(mine, int | float) and isinstance(its, int | float) and beyond * (mine - its) > 0:
            return name
    if "unit" in given and "unit" in own and given["unit"] != own["unit"]:
        return "unit"
    return "enum" if "enum" in own and not {*map(str, given.get("enum", ()))} <= {*map(str, own["enum"])} else ""


RULES = (Rule("IDENTIFY-FACT-DIFFERS", fact_differs), Rule("IDENTIFY-PROFILE-WIDENED", profile_widened))
