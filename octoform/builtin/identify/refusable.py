"""Makes a device unknown whose name the stage's contract would refuse, so that one string never ends an onboarding.

The agent knows the rule from the spec, in its own terms: a name that says only how a product is wired names no product.
It is judged on the final annotation, whoever gave the name: strings, a database, an answer, a profile.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any

from octoform.builtin.identify import naming
from octoform.builtin.identify.evidence import Device
from octoform.builtin.identify.identity import Identity
from octoform.builtin.identify.verdict import UNKNOWN, Evidence
from octoform.builtin.identify.vocabulary import GENERIC

_MISSING = "The name that it goes by says only how it is wired; what is this device, by maker and model?"
_ASKED = "What it says of itself could not be taken as it is; what is this device, by maker and model?"
_UNTOLD = "nothing that it says of itself could be taken as it is"
_ACTING = ("sensor", "actuator", "bidirectional")
_WIRES = frozenset(
    (
        *("serial", "uart", "usart", "rs232", "rs422", "rs485", "ttl", "bridge"),
        *("i2c", "smbus", "spi", "jtag", "vcp"),
    )
)
_HEADS = frozenset(("adapter", "adaptor", "converter", "bridge", "cable", "dongle", "chip"))
_FILLER = frozenset(
    (
        *("usb", "usb2", "usb3", "to", "the", "a", "an", "of", "and", "for", "port", "ports", "device", "interface"),
        *("generic", "unknown", "unidentified", "controller", "virtual", "com", "cdc", "acm", "hid", "composite"),
        *("tty", "single", "dual", "quad", "full", "high", "speed", "chipset", "ic", "board", "module", "based"),
        *("inc", "ltd", "co", "corp", "corporation", "limited", "gmbh", "international", "electronics", "technology"),
        *("technologies", "semiconductor", "semiconductors", "labs", "laboratories", "devices", "company", "vendor"),
    )
)
_PART_NUMBER = re.compile(r"[a-z]{0,5}\d{2,6}[a-z0-9]{0,6}")
_MAKER_LINE = re.compile(r"^[^:\n]*(?:manufacturer|vendor|maker)[^:\n]*:(.*)$", re.IGNORECASE | re.MULTILINE)
_APPOSITION = re.compile(r"\s(?:with|via|through|behind|over|using|on)\s|[(,;:]", re.IGNORECASE)
_STANDARD = re.compile(r"(?i)\brs[- ]?(232|422|485)\b")


def accepted(device: Device, annotation: dict[str, Any]) -> dict[str, Any]:
    """The annotation, or that of an unknown device with the reason where its name would be refused."""
    name, makers = annotation["identified_as"], [line.strip() for line in _MAKER_LINE.findall(device.raw)]
    # A maker's own words may hide that all behind them is wiring.
    bare = next((name[len(maker) :] for maker in makers if maker and name.startswith(maker)), name)
    if annotation["category"] not in _ACTING or not any(names_wires(text, device.raw) for text in (name, bare)):
        return annotation
    return unknown(annotation, _MISSING)


def without_refused(artifact: dict[str, Any], refused: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """The artifact again, without what was refused of it: such a device is unknown, and one that was is left out.

    Whatever rule of the contract this agent does not know costs one device, and never the host.
    """
    before = {str(entry.get("id")): entry.get("category") for entry in refused}
    kept, left_out = [], list(artifact["left_out"])
    for annotation in artifact["devices"]:
        category = before.get(annotation["id"])
        if category == UNKNOWN:
            left_out.append({"id": annotation["id"], "reason": "unknown_meaning", "detail": _UNTOLD})
        else:
            kept.append(annotation if category is None else unknown(annotation, _ASKED))
    return {**artifact, "devices": kept, "left_out": left_out}


def unknown(annotation: dict[str, Any], missing: str) -> dict[str, Any]:
    """The annotation as that of a device of which nothing is known but its name; ``missing`` is the open question."""
    kept: dict[str, Any] = {
        key: annotation[key] for key in ("id", "identified_as", "class", "evidence") if key in annotation
    }
    return {
        **kept,
        "category": UNKNOWN,
        "confidence": 0.0,
        "method": "none",
        "capabilities": [],
        "missing": missing,
    }


def is_borne_out(named: Identity, cited: Iterable[Evidence]) -> bool:
    """True when each telling word of a name stands in a quote, or as a plain word in what follows from one."""
    evidence = (*named.evidence, *cited)
    quoted = {word for each in evidence for word in naming.words(each.quote)}
    quoted |= {word for each in evidence for word in re.findall(r"[^\W_]+", each.quote.casefold())}
    said = {word for each in evidence for word in naming.words(each.says)}
    if named.method == "id_database":
        quoted |= said
    missing = [word for word in re.findall(r"[^\W_]+", naming.spread(named.name)) if not _is_class(word.casefold())]
    return all(word.casefold() in quoted or (word.islower() and word.isalpha() and word in said) for word in missing)


def _is_class(word: str) -> bool:
    return word in GENERIC or word in _FILLER or word in _WIRES or word in _HEADS or len(word) < 2


def names_wires(name: str, raw: str) -> bool:
    """True for a name that says how a product is wired, or which chip wires it, and nothing of the product."""
    words = _words(_APPOSITION.split(name.strip(), maxsplit=1)[0] or name)
    if _WIRES.isdisjoint(words):
        return False
    makers = {word for line in _MAKER_LINE.findall(raw) for word in _words(line)}
    left = [word for word in words if not _says_nothing(word) and word not in makers]
    return not left or (words[-1] in _HEADS and len(left) <= 1)


def _says_nothing(word: str) -> bool:
    if word in _WIRES or word in _HEADS or word in _FILLER or len(word) < 2:
        return True
    return word.isdigit() or _PART_NUMBER.fullmatch(word) is not None


def _words(text: str) -> list[str]:
    return [word for word in re.split(r"[^0-9a-z]+", _STANDARD.sub(r"rs\1", text).casefold()) if word]
