"""A name rests on its evidence: a device's name must have a source that a reader can look up.

A quote that stands verbatim in PROBE proves little when the name beside it has nothing to do with it ("driver: usbhid"
under the name of a robot). So in a name that claims to be known each word is either a word of class, which states what
kind of thing it is, or is in what is cited: a maker, a model, a word with a digit in a quote; a word that
describes, at least in what is stated to follow from a quote. A kind of thing follows from a class of the kernel, or is
stated by the device. What an id database reports is looked up in those of the host.
"""

import re
from collections.abc import Iterable

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.contracts.device_kinds import INPUT_KINDS, INPUTS, KINDS, RAW, SAME_KIND, speaks_bytes
from octoform.contracts.device_kinds import visible_kinds as ways_of
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.name_clues import is_class_word, is_filler, kind_of
from octoform.contracts.name_words import has_digit, is_proper, missing, names_language, parts, word_set, words
from octoform.contracts.rules.identify import answer_rules
from octoform.contracts.rules.identify.answer_rules import is_quoted
from octoform.contracts.rules.identify.prose_rules import is_foreign
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex

# From here on a name is claimed to be known; below, only the kind of device is claimed.
CLAIMED = 0.5
ACTING = ("sensor", "actuator", "bidirectional")
_DATABASE, _WEB, _ANSWER = "id_database", "web_search", answer_rules.METHOD
_OBSERVED = ("kernel_class", "descriptor_driver")
_KEY = regex(r"(?m)^[\w.\[\]-]+(?: \w+)?: ")
PAGE = regex(r"\b[\w-]+(?:\.[\w-]+)*\.[a-z]{2,}\b(?!\S*(?:/search\b|[?&](?:q|query|search)=))")
"""The address of a page; that of a search is none, whose results are others on the next day."""
_SEVERAL = regex(r"\s/\s|[,;]|\bor\b|\bseries\b|\bfamily\b", re.IGNORECASE)
_SOURCE = regex(r"(?i)\b(?:usb|pci|sdio)\.ids\b|\bhwdb\b|\bid database\b")
_HEAD = regex(r"\s(?:with|via|through|behind|over|using|on|for|in|beside|under)\s|[(,;:/]", re.IGNORECASE)
_WITH = regex(r"(?i)\s(?:with|and|plus)\s")
# Numbers of a kind's registration, which a name does not consist of.
_CODES = regex(r"(?m)^(?:[\w.\[\]]*(?:_id|_code|revision|modalias|alias|_class|\.id|usages)|interface \w+): .*$")
_BOOT = regex(r"\bclass 03/01/0[12]\b")
"""A keyboard or a mouse by its USB class alone (HID 1.11, section 4.3)."""
_DECLARED = regex(r"(?m)^hid\[\d+\]\.usages: (?:ff\w*/\w+,)*(?!ff)[0-9a-f]{4}/|^udev\.(?!ID_MM_)[A-Z]\w+: 1$")
"""What a device is for, by a usage of a standard page (from ff00 on they are a vendor's) or by a rule of the system."""
_QUALITIES: dict[str, tuple[str, ...]] = {
    "thermal": ("thermal", "hwmon", "cooling"),
    "bluetooth": ("bluetooth", "usb-e0"),
    "wireless": ("net", "ieee80211", "bluetooth", "rfkill", "usb-e0", "wwan"),
    "infrared": ("rc", "lirc"),
    "stereo": ("sound", "hdaudio"),
    "ir": ("rc", "lirc"),
    "tv": ("dvb",),
    **dict.fromkeys(("fingerprint", "oled", "laser", "depth", "rfid", "nfc", "fhd", "uhd", "3d", "quad"), ()),
    **dict.fromkeys(("microscope", "telescope", "oscilloscope", "multimeter", "barcode", "biometric", "projector"), ()),
    **dict.fromkeys(("phone", "telephone", "aquarium", "weather", "synthesizer", "thermostat"), ()),
}
"""Words of class that make another product of a thing, and the classes from which they follow."""
_AS_QUALITY = {"wireless": frozenset({"wifi", "wlan", "radio", "bluetooth", "rf", "dongle", "receiver"})}
_TELLING_KEYS = ("product", "model", "name", "manufacturer", "vendor", "udev.ID_MODEL_FROM_DATABASE", "driver")
_GRAMMAR = frozenset(
    (
        *("by", "with", "in", "on", "at", "from", "class", "built", "made", "its", "as", "or", "no", "not", "only"),
        *("model", "shown", "unknown", "two", "four", "this", "that", "one", "first", "second", "third", "fourth"),
        *("behind", "beside", "revision", "rev"),
        *("mk", "mark", "type", "version", "kind", "own", "per", "each", "all"),
    )
)
_VAGUE = frozenset(
    (
        *("usb", "usb2", "usb3", "pci", "pcie", "hid", "i2c", "spi", "device", "devices", "unknown", "unidentified"),
        *("generic", "thing", "peripheral", "hardware", "component", "composite", "vendor", "specific", "something"),
        *("some", "a", "an", "the", "of", "object", "item", "module", "unit", "interface"),
    )
)
_OWN_STRINGS = regex(r"(?m)^(?:product|model|name|hid\[\d+\]\.name): (.*)$")
_LABELS = regex(r"(?m)^interface \w+: .*?\blabel=(.*)$")
# Classes of which each device of a bus has one, whatever it is.
_BARE = RAW | {"usb-02", "usb-03"}
_CODE = "IDENTIFY-NAME-WITHOUT-EVIDENCE"


def name_without_evidence(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each word of a name that is claimed to be known is one of class, or is in the evidence for it."""
    out = []
    for index, device, probed in _claims(value, artifacts):
        entry = _entry(device, artifacts)
        where = pointer("devices", index, "identified_as")
        if device["category"] in ACTING and _VAGUE.issuperset(map(str.casefold, words(device["identified_as"]))):
            summary = f"the name {display(device['identified_as'])} of {display(device['id'])} names no kind of thing"
            hint = "name what the strings name, or the kind of thing that its class shows"
            out.append(error(_CODE, summary, pointer=where, detail=_own_words(probed, entry), hint=hint))
        elif unsaid := _unsupported(device, probed, entry, artifacts):
            summary = f"nothing that is cited for {display(device['id'])} has {', '.join(map(display, unsaid))}"
            hint = _hint(device["method"], entry, [word for word in unsaid if kind_of(word.casefold())])
            out.append(error(_CODE, summary, pointer=where, detail=_own_words(probed, entry), hint=hint))
    for index, device in enumerate(value["devices"]):
        if beyond := _beyond_profile(device, artifacts):
            summary = (
                f"the product of the profile {display(device['profile'])} has no {', '.join(map(display, beyond))}"
            )
            hint = f"name it as the profile does: {artifacts.profiles[device['profile']].product}"
            out.append(error(_CODE, summary, pointer=pointer("devices", index, "identified_as"), hint=hint))
    return out


def source_false(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """A citation of an id database must be in the database: octoform looks it up."""
    out = []
    for index, device, probed in _claims(value, artifacts):
        entry = _entry(device, artifacts)
        if entry is None or _unsupported(device, probed, entry, artifacts):
            continue  # no database was read, or the name itself is the finding
        known = word_set([entry, *_texts(probed)])
        for at, evidence in enumerate(device["evidence"]):
            text = evidence.get("says", "")
            source = _SOURCE.search(text)
            after = text[source.end() :] if source else ""
            unsaid = [
                word
                for word in missing(words(after), known)
                if _is_distinctive(word.casefold()) and is_proper(word, text)
            ]
            if unsaid:
                cited = ", ".join(dict.fromkeys(display(word) for word in _as_written(after, unsaid)))
                summary = f"no id database of this host has {cited} for {display(device['id'])}"
                message = f"it has {display(entry)}" if entry else "none below this host's root knows these numbers"
                where = pointer("devices", index, "evidence", at, "says")
                hint = (
                    f"{message}; write what follows from the quote, and name a database only for the words of its entry"
                )
                out.append(error("IDENTIFY-SOURCE-FALSE", summary, pointer=where, hint=hint))
    return out


def _as_written(text: str, unsaid: Iterable[str]) -> list[str]:
    """The words as the text writes them: HC-2 for HC."""
    return [each.strip(".,;:()\"'") for each in text.split() if not {*words(each)}.isdisjoint(unsaid)]


def guess(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """At the end of a raw line nothing is guessed: what no string states is unknown, with the confidence 0."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        known = probed.get(device["id"])
        if known is None or known.get("context") or device["confidence"] >= CLAIMED or device["category"] not in ACTING:
            continue
        if device["id"] in artifacts.answers or "profile" in device or not speaks_bytes(known):
            continue
        if known["interface"] != "usb":
            continue  # what is soldered in is on a bus that describes it better
        if is_foreign(device["identified_as"], device["id"], artifacts):
            continue
        if unsaid := _guessed(device, known, _entry(device, artifacts)):
            summary = f"no string of {display(device['id'])} has {', '.join(map(display, unsaid))}: that is a guess"
            hint = "write category unknown, confidence 0.0, no capabilities, and ask in `missing` what would settle it"
            hint += "; where the strings have it in another language, name the language in `says`"
            where = pointer("devices", index, "identified_as")
            out.append(error("IDENTIFY-GUESS", summary, pointer=where, detail=_own_words(known, None), hint=hint))
    return out


def _guessed(device: JsonObject, probed: JsonObject, entry: str | None) -> list[str]:
    """The words of a name that neither the device reports nor a class bears out; of a line nothing follows, either."""
    lines = [each.get("says", "") for each in device["evidence"] if entry is None]  # no database was read
    own = word_set([*_texts(probed), entry or "", *(text for text in lines if _SOURCE.search(text))])
    own |= parts(own) | _meanings(device) | {SAME_KIND[word] for word in own if word in SAME_KIND}
    follows = (
        own if "tty" in probed.get("classes", ()) else own | word_set(e.get("says", "") for e in device["evidence"])
    )
    ways, spelt = ways_of(probed), words(device["identified_as"])
    kinds = [word for word in spelt if kind_of(word.casefold())]
    moving = [word for word in kinds if not KINDS[kind_of(word.casefold()) or ""]]
    others = [word for word in kinds if word not in moving and ways.isdisjoint(KINDS[kind_of(word.casefold()) or ""])]
    telling = [word for word in spelt if _is_distinctive(word.casefold())]
    proper = [word for word in telling if is_proper(word, device["identified_as"])]
    foreign = not all(text.isascii() for text in _texts(probed))  # its words may say the same in another language
    unsaid = {*missing(moving + proper, own), *([] if foreign else missing(others + telling, follows))}
    raw = str(probed["raw_descriptor"])
    bare = ways <= _BARE and not _BOOT.search(raw) and not _DECLARED.search(raw)
    if not (telling or kinds) and bare and not _speaks(probed):
        unsaid |= {word for word in spelt if word.casefold() not in _VAGUE} or {*spelt}  # a pipe is no kind of thing
    return [word for word in dict.fromkeys(spelt) if word in unsaid]


RULES = (
    Rule(_CODE, name_without_evidence),
    Rule("IDENTIFY-SOURCE-FALSE", source_false),
    Rule("IDENTIFY-GUESS", guess),
)


def _claims(value: JsonObject, artifacts: Artifacts) -> Iterable[tuple[int, JsonObject, JsonObject]]:
    """(index, annotation, PROBE entry) of the devices whose name is claimed to be known, on quotes that are there."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    for index, device in enumerate(value["devices"]):
        known = probed.get(device["id"], {})
        verbatim = all(is_quoted(evidence["quote"], known, artifacts) for evidence in device["evidence"] if known)
        is_known = device["method"] != "profile" and (device["method"] != _ANSWER or device["id"] in artifacts.answers)
        foreign = is_foreign(device["identified_as"], device["id"], artifacts)
        if device["confidence"] >= CLAIMED and is_known and verbatim and not foreign:
            yield index, device, known


def _held_products(device: JsonObject, artifacts: Artifacts) -> list[str]:
    """The product's name in the profile that matches a device and that its annotation names."""
    facts = artifacts.profiles.get(device.get("profile", ""))
    return [facts.product] if facts is not None and device["id"] in facts.holds else []


def _entry(device: JsonObject, artifacts: Artifacts) -> str | None:
    """The entry of the host's databases for a device; "" for none, None where they were not read."""
    return None if artifacts.registered is None else artifacts.registered.get(device["id"], "")


def _texts(probed: JsonObject) -> list[str]:
    return [_KEY.sub("", str(probed.get(member, ""))) for member in ("name", "raw_descriptor")]


def _unsupported(device: JsonObject, probed: JsonObject, entry: str | None, artifacts: Artifacts) -> list[str]:
    """The words of the name, as they are spelt there, that nothing bears out."""
    name = device["identified_as"]
    spelt = words(name)
    telling = [word for word in spelt if _is_distinctive(word.casefold())]
    denied = answer_rules.denied_words(device["id"], artifacts) - word_set(_texts(probed))
    quoted = word_set(_KEY.sub("", evidence["quote"]) for evidence in device["evidence"]) - _codes(probed) - denied
    answer = word_set([*answer_rules.texts(device["id"], artifacts), *_held_products(device, artifacts)]) - denied
    bare = _of_class(spelt, quoted, probed) if not telling and device["method"] != _ANSWER else []
    cited = quoted | answer | word_set([entry or ""])
    untold = [] if bare else _kinds(name, device, probed, cited) + _qualities(spelt, device, probed, cited)
    apart = missing(spelt, quoted | answer)  # a word of class may be a part of a model's name
    if device["method"] == _ANSWER and RAW.issuperset(ways_of(probed)):
        untold += _beside(name, cited | word_set(_texts(probed)) | _translated(device))
    unnamed = [word for word in _unnamed(device, probed, entry, telling, quoted | answer) if word in apart]
    unsaid = {*unnamed, *untold, *bare}
    return [word for word in dict.fromkeys(spelt) if word in unsaid]


def _of_class(spelt: list[str], quoted: frozenset[str], probed: JsonObject) -> list[str]:
    """Words of class alone follow from what the kernel shows; of a raw line it shows nothing."""
    raw = probed.get("classes") and RAW.issuperset(probed["classes"])
    none_is_quoted = len(missing(spelt, quoted)) == len(spelt)
    return [word for word in spelt if is_class_word(word.casefold())] if raw and none_is_quoted else []


def _kinds(name: str, device: JsonObject, probed: JsonObject, cited: frozenset[str]) -> list[str]:
    """The words for a kind of thing that neither a class of the kernel bears out nor anything that is stated."""
    head = words(_HEAD.split(name.strip(), maxsplit=1)[0] or name)
    own = cited | word_set(_texts(probed)) | _translated(device)
    own |= {"motor"} if {"stepper", "servo"} & own else set()
    ways, found = ways_of(probed), INPUT_KINDS.search(str(probed.get("raw_descriptor", "")))
    return [
        word
        for word in missing([word for word in head if kind_of(word.casefold())], own | parts(own))
        if ways.isdisjoint(KINDS[kind_of(word.casefold()) or ""]) or (found and kind_of(word.casefold()) in INPUTS)
    ]


def _qualities(spelt: list[str], device: JsonObject, probed: JsonObject, cited: frozenset[str]) -> list[str]:
    """The words that make another product of a thing and that nothing of the device bears out."""
    given = [word for word in spelt if word.casefold() in _QUALITIES]
    if not given:
        return []
    own, ways = cited | word_set(_texts(probed)) | _translated(device), ways_of(probed)
    own |= {quality for quality, words_of in _AS_QUALITY.items() if not own.isdisjoint(words_of)}
    return [word for word in missing(given, own | parts(own)) if ways.isdisjoint(_QUALITIES[word.casefold()])]


def _beside(name: str, known: frozenset[str]) -> list[str]:
    """Of what a name by an answer has beside the thing ("with a flow meter"), the words that are not known."""
    parts_of = words(" ".join(_WITH.split(name)[1:]))
    loose = [word for word in parts_of if is_class_word(word.casefold()) and not is_filler(word.casefold())]
    return missing(loose, known | parts(known))


def _beyond_profile(device: JsonObject, artifacts: Artifacts) -> list[str]:
    """Of a name by a profile, the words that neither the profile's product has nor the device or its owner."""
    facts = artifacts.profiles.get(device.get("profile", ""))
    if device["method"] != "profile" or facts is None or not facts.product or device["id"] not in facts.holds:
        return []
    probed: JsonObject = next((each for each in (artifacts.probe or {})["devices"] if each["id"] == device["id"]), {})
    answer = answer_rules.texts(device["id"], artifacts)
    own = word_set([facts.product, facts.name, *_texts(probed), *answer])
    spelt = words(device["identified_as"])
    return [word for word in missing(spelt, own | parts(own) | _translated(device)) if _is_distinctive(word.casefold())]


def _unnamed(
    device: JsonObject, probed: JsonObject, entry: str | None, words_given: list[str], quoted: frozenset[str]
) -> list[str]:
    """Of the words that distinguish one product from another, those that nothing states."""
    spoken = word_set(evidence.get("says", "") for evidence in device["evidence"])
    if device["method"] == _DATABASE:
        models = _models(words(entry or ""))
        whole = not _SEVERAL.search(entry or "") or not missing(models, word_set([device["identified_as"]]))
        unsaid = missing(words_given, quoted | (spoken if entry is None else word_set([entry])))
        # An entry may stand for several products: what names one of them alone needs a string of the device.
        return unsaid or ([] if whole else missing(_models(words_given), quoted))
    if device["method"] == _WEB:
        says = " ".join(evidence.get("says", "") for evidence in device["evidence"])
        linked = any(len(word) > 3 and word in spoken for word in quoted if not is_class_word(word))
        return missing(words_given, quoted | spoken if linked and PAGE.search(says) else quoted)
    own = frozenset(word for word in word_set(_texts(probed)) if word[0].isalpha())  # an id's digits are in no name
    profile = word_set([str(device.get("profile", ""))])
    unsaid, unshown = missing(words_given, quoted | spoken | own), missing(words_given, quoted | own)
    return [
        word
        for word in missing(words_given, quoted | _translated(device) | profile)
        if word in unsaid or (has_digit(word) and word in unshown) or is_proper(word, device["identified_as"])
    ]


def _translated(device: JsonObject) -> frozenset[str]:
    """The words of what is stated about a language or a meaning; a number is no translation."""
    lines = [evidence.get("says", "") for evidence in device["evidence"]]
    return frozenset(word for word in word_set(text for text in lines if names_language(text)) if not has_digit(word))


def _speaks(probed: JsonObject) -> bool:
    """Whether a device calls itself anything, in more than words that say nothing; in a label its wires say nothing."""
    raw = str(probed["raw_descriptor"])
    spoken = [word.casefold() for text in _OWN_STRINGS.findall(raw) for word in words(text)]
    labels = (word.casefold() for text in _LABELS.findall(raw) for word in words(text))
    spoken += [word for word in labels if not is_filler(word)]
    return any(not word.isdigit() and word not in _VAGUE | _GRAMMAR for word in spoken)


def _meanings(device: JsonObject) -> frozenset[str]:
    """The translations of quotes that hold a word to translate: no word of wiring or class, no part's number."""
    quotes = [(evidence, words(_KEY.sub("", evidence["quote"]))) for evidence in device["evidence"]]
    kept = [
        each
        for each, spelt in quotes
        if any(_is_distinctive(word.casefold()) and not has_digit(word) for word in spelt)
    ]
    return _translated({"evidence": kept})


def _codes(probed: JsonObject) -> frozenset[str]:
    """The numbers that are nowhere of a device but in lines of its registered numbers."""
    raw = str(probed.get("raw_descriptor", ""))
    elsewhere = word_set([_CODES.sub("", raw)])
    return frozenset(word for word in word_set(_CODES.findall(raw)) if has_digit(word) and word not in elsewhere)


def _is_distinctive(word: str) -> bool:
    """False for what could be in any name, and for what states the kind of thing; a number distinguishes models."""
    return word.isdigit() or not (word in _GRAMMAR or is_filler(word) or is_class_word(word))


def _models(of: Iterable[str]) -> list[str]:
    """The words that distinguish one model from another: those with a digit."""
    return [word for word in of if has_digit(word)]


def _own_words(probed: JsonObject, entry: str | None) -> str | None:
    """The possible sources of a name: the device's own lines, and the database's entry for its numbers."""
    lines = str(probed.get("raw_descriptor", "")).splitlines()
    items = [line for key in _TELLING_KEYS for line in lines if line.startswith(f"{key}: ")]
    items = [f"PROBE has {display(line)}" for line in items[:4]]
    return "\n".join([*items, *([f"the host's id database has {display(entry)}"] if entry else [])]) or None


def _hint(method: str, entry: str | None, kinds: list[str]) -> str:
    if kinds:
        ways = sorted({way for word in kinds for way in KINDS[kind_of(word.casefold()) or ""]})
        leads = f"a class such as {', '.join(ways[:3])}" if ways else "a string of the device, or its owner's word"
        return f"{', '.join(map(display, kinds))} would follow from {leads}; leave it out, or the device is unknown"
    if method == _DATABASE and entry == "":
        return "no id database of this host knows these numbers: quote what names it, or lower the confidence below 0.5"
    if method == _DATABASE:
        return (
            "name what the entry names; where it names several products, the model needs a string of the device itself"
        )
    if method == _WEB:
        return "quote the string that the page speaks of; write into `says` the page's address and what follows from it"
    if method == _ANSWER:
        return "name it with the owner's words and those of the device; name another language in `says`"
    if method in _OBSERVED:
        return (
            "quote the line that has it; a word that only describes may follow in `says`; or name the kind of thing "
            "alone, or lower the confidence below 0.5"
        )
    return "quote the string that holds it, leave the word out, or lower the confidence below 0.5"
