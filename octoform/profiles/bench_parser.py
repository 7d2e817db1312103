"""Read the ``rig`` of a profile: what holds for the owner's own copy alone, apart from what holds for the product."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from octoform.profiles.definitions.definition import Grammar, RegisterGrammar
from octoform.profiles.definitions.problems import Found, near
from octoform.profiles.definitions.register_parser import MOST_ID
from octoform.profiles.model import Rig

OF_UNITS = ("disabled", "units")
FIELDS = ("facts", "limits", *OF_UNITS)
MOST_FACTS, FACT_CHARS = 20, 300
PLACE = ("rig",)


def read(found: Found, given: object, limits: tuple[Mapping[str, Any], ...], grammar: Grammar | None) -> Rig:
    """The rig that a front-matter value says, its limits being read already; every problem of it in ``found``."""
    if not isinstance(given, Mapping):
        found.add(PLACE, "rig is no mapping", "write rig: {facts: [...], limits: [...]}")
        return Rig()
    facts = given.get("facts", [])
    sound = [item for item in facts if _is_sentence(item)] if isinstance(facts, list) else []
    if not isinstance(facts, list) or len(sound) < len(facts) or len(facts) > MOST_FACTS:
        summary = f"the facts of the rig are no list of at most {MOST_FACTS} sentences"
        found.add((*PLACE, "facts"), summary, f"one line each, at most {FACT_CHARS} characters")
    named = [name for name in OF_UNITS if name in given]
    if named and not isinstance(grammar, RegisterGrammar):
        for name in named:
            hint = "only a grammar of registers names units; write what is true of your copy under facts"
            found.add((*PLACE, name), f"{name!r} of the rig without units in the grammar", hint)
        return Rig(tuple(sound), limits)
    product = grammar.registers.units if isinstance(grammar, RegisterGrammar) else {}
    disabled = {
        str(unit): reason
        for unit, reason in _of_units(found, given, "disabled", product).items()
        if _is_reason(found, str(unit), reason)
    }
    return Rig(tuple(sound), limits, disabled, _renumbered(found, given, product))


def fitted(grammar: Grammar | None, rig: Rig) -> Grammar | None:
    """The grammar as it is on the rig."""
    if not isinstance(grammar, RegisterGrammar):
        return grammar
    return replace(grammar, registers=replace(grammar.registers, renumbered=rig.units, disabled=rig.disabled))


def _of_units(found: Found, given: Mapping[str, Any], name: str, units: Mapping[str, int]) -> dict[str, Any]:
    """The members of a mapping whose names are units."""
    place, listed = (*PLACE, name), given.get(name, {})
    if not isinstance(listed, Mapping):
        example = "disabled: {base: the motor is broken}" if name == "disabled" else "units: {base: 2, tip: 1}"
        found.add(place, f"{name!r} of the rig is no mapping of units", f"write {example}")
        return {}
    for unit in listed:
        if unit not in units:
            found.add((*place, unit), f"{unit!r} is no unit of the grammar", near(str(unit), units, "its units are "))
    return {unit: value for unit, value in listed.items() if unit in units}


def _is_reason(found: Found, unit: str, reason: object) -> bool:
    if _is_sentence(reason):
        return True
    hint = f"one line of at most {FACT_CHARS} characters; callers are told it"
    found.add((*PLACE, "disabled", unit), f"nothing says why {unit!r} is disabled", hint)
    return False


def _renumbered(found: Found, given: Mapping[str, Any], product: Mapping[str, int]) -> dict[str, int]:
    place = (*PLACE, "units")
    listed = _of_units(found, given, "units", product)
    ids = {unit: found.whole(listed, unit, place, (0, MOST_ID)) for unit in listed}
    whole = {**product, **ids}
    for unit, number in ids.items():
        other = next((name for name in whole if name != unit and whole[name] == number), None)
        if other is not None:
            hint = f"say as well which id {other!r} has on your copy"
            found.add((*place, unit), f"the id {number} of {unit!r} is the one of {other!r}", hint)
    return ids


def _is_sentence(item: object) -> bool:
    return isinstance(item, str) and bool(item.strip()) and item.isprintable() and len(item) <= FACT_CHARS
