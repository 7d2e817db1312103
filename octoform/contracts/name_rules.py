"""The rule that a name rests on its evidence: what a device is called must be said somewhere that a reader can look up.

A quote that stands verbatim in PROBE proves little when the name beside it has nothing to do with it ("driver: usbhid"
under the name of a robot). So in a name that claims to be known each word is either a word of class, which says what
kind of thing it is, or stands in what is cited: a maker, a model, a word with a digit in a quote; a word that
describes, at least in what is said to follow from a quote. What an id database says is looked up in those of the host.
"""

import re
import unicodedata
from collections.abc import Iterable, Sequence

from octoform.contracts.answer_rules import stands_in
from octoform.contracts.model import Artifacts, JsonObject
from octoform.contracts.naming import is_class_word, says_nothing
from octoform.contracts.raw_line_rules import RAW
from octoform.contracts.text import pointer, shown
from octoform.diagnostics import Diagnostic, error

# From here on a name is claimed to be known; below, the kind of thing is all that is said.
CLAIMED = 0.5
_DATABASE, _WEB = "id_database", "web_search"
_OBSERVED = ("kernel_class", "descriptor_driver")
# The owner's own words stand in the manifest or in a profile; octoform checks them by rules of their own.
_OWNERS = ("user_answer", "profile")
_KEY = re.compile(r"(?m)^[\w.\[\]-]+(?: \w+)?: ")
_ESCAPE = re.compile(r"\\x[0-9a-f]{2}|\\u[0-9a-f]{4}|\\U[0-9a-f]{8}")
_SPREAD = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")
_WORD = re.compile(r"[^\W_]+")
_PAGE = re.compile(r"\b[\w-]+(?:\.[\w-]+)*\.[a-z]{2,}\b")
_SEVERAL = re.compile(r"\s/\s|[,;]|\bor\b|\bseries\b|\bfamily\b", re.IGNORECASE)
_TELLING_KEYS = ("product", "model", "name", "manufacturer", "vendor", "udev.ID_MODEL_FROM_DATABASE", "driver")
_GRAMMAR = frozenset(
    (
        "by",
        "with",
        "in",
        "on",
        "at",
        "from",
        "class",
        "built",
        "made",
        "its",
        "as",
        "or",
        "no",
        "not",
        "only",
        "model",
        "shown",
        "unknown",
        "two",
        "four",
    )
)
_CODE = "IDENTIFY-NAME-WITHOUT-EVIDENCE"
_LONGEST_RUN = 3


def name_without_evidence(value: JsonObject, artifacts: Artifacts) -> list[Diagnostic]:
    """Each word of a name that is claimed to be known is one of class, or stands in the evidence for it."""
    probed = {device["id"]: device for device in (artifacts.probe or {}).get("devices", ())}
    out = []
    for index, device in enumerate(value["devices"]):
        if device["confidence"] < CLAIMED or device["method"] in _OWNERS:
            continue
        known = probed.get(device["id"], {})
        if known and not all(stands_in(evidence["quote"], known, artifacts) for evidence in device["evidence"]):
            continue  # another rule's finding, and the cause of this one
        entry = None if artifacts.registered is None else artifacts.registered.get(device["id"], "")
        if missing := _unsupported(device, known, entry):
            summary = f"nothing that is cited for {shown(device['id'])} says {', '.join(map(shown, missing))}"
            where, detail = pointer("devices", index, "identified_as"), _own_words(known, entry)
            out.append(error(_CODE, summary, pointer=where, detail=detail, hint=_hint(device["method"], entry)))
    return out


def _unsupported(device: JsonObject, probed: JsonObject, entry: str | None) -> list[str]:
    """The words of the name, as they are spelt there, that nothing bears out."""
    words = _words(device["identified_as"])
    telling = [word for word in words if _tells(word.casefold())]
    quoted = _said(_KEY.sub("", evidence["quote"]) for evidence in device["evidence"])
    said = _said(evidence.get("says", "") for evidence in device["evidence"])
    if not telling:
        # Words of class alone follow from what the kernel shows; of a raw line it shows nothing.
        raw = probed.get("classes") and RAW.issuperset(probed["classes"])
        return [word for word in words if is_class_word(word.casefold())] if raw and not _any(words, quoted) else []
    if device["method"] == _DATABASE:
        whole = not _SEVERAL.search(entry or "") or not _missing(_models(_words(entry or "")), _said([" ".join(words)]))
        registered = said if entry is None else _said([entry])
        missing = _missing(telling, quoted | registered)
        # An entry may stand for several products: what names one of them alone needs a string of the device.
        return missing or ([] if whole else _missing(_models(telling), quoted))
    if device["method"] == _WEB:
        says = " ".join(evidence.get("says", "") for evidence in device["evidence"])
        linked = any(len(word) > 3 and word in said for word in quoted if not is_class_word(word))
        return _missing(telling, quoted | said if linked and _PAGE.search(says) else quoted)
    own = _said(_KEY.sub("", str(probed.get(member, ""))) for member in ("name", "raw_descriptor"))
    own = frozenset(word for word in own if word[0].isalpha())  # an id's digits are in no name
    unquoted, unsaid = _missing(telling, quoted), _missing(telling, quoted | said | own)
    unshown = _missing(telling, quoted | own)
    return [
        word
        for word in unquoted
        if word in unsaid or (_has_digit(word) and word in unshown) or _is_proper(word, device["identified_as"])
    ]


def _tells(word: str) -> bool:
    """False for what could stand in any name, and for what says the kind of thing; a number tells models apart."""
    return word.isdigit() or not (word in _GRAMMAR or says_nothing(word) or is_class_word(word))


def _models(words: Iterable[str]) -> list[str]:
    """The words that tell one model from another: those with a digit."""
    return [word for word in words if _has_digit(word)]


def _has_digit(word: str) -> bool:
    return any(sign.isdigit() for sign in word)


def _missing(words: Sequence[str], said: frozenset[str]) -> list[str]:
    """The words that are not said, plurals folded; several in a row may be one word there ('Quick Cam', 'QuickCam')."""
    folded = [word.casefold() for word in words]
    borne: set[int] = set()
    for length in range(1, _LONGEST_RUN + 1):
        for start in range(len(folded) - length + 1):
            run = folded[start : start + length]
            if _fold("".join(run)) in said or "".join(run) in said:
                borne.update(range(start, start + length))
    return [word for at, word in enumerate(words) if at not in borne]


def _any(words: Sequence[str], said: frozenset[str]) -> bool:
    return len(_missing(words, said)) < len(words)


def _said(texts: Iterable[str]) -> frozenset[str]:
    """Every word of the texts, also run together with its neighbours, plurals folded."""
    found = set()
    for text in texts:
        plain = unicodedata.normalize("NFKC", _ESCAPE.sub(" ", text))
        for spread in (plain, _SPREAD.sub(" ", plain)):
            words = [word.casefold() for word in _WORD.findall(spread)]
            for length in range(1, _LONGEST_RUN + 1):
                found |= {"".join(words[at : at + length]) for at in range(len(words) - length + 1)}
    return frozenset(found | {_fold(word) for word in found})


def _fold(word: str) -> str:
    """A word without the ending of a plural; what ends in double s is none."""
    return word[:-1] if len(word) > 3 and word.endswith("s") and not word.endswith("ss") else word


def _words(text: str) -> list[str]:
    return _WORD.findall(_SPREAD.sub(" ", unicodedata.normalize("NFKC", text)))


def _is_proper(word: str, name: str) -> bool:
    """A maker's or a model's word: a number, or one with a capital that does not only begin a sentence."""
    if word.isdigit() or word[1:] != word[1:].lower():
        return True
    begins = name.strip().startswith(word) and not any(each[0].isupper() for each in _words(name)[1:])
    return word[0].isupper() and not begins


def _own_words(probed: JsonObject, entry: str | None) -> str | None:
    """What would bear out a name: the device's own lines, and what the host's database says of its numbers."""
    lines = str(probed.get("raw_descriptor", "")).splitlines()
    told = [line for key in _TELLING_KEYS for line in lines if line.startswith(f"{key}: ")]
    told = [f"PROBE says {shown(line)}" for line in told[:4]]
    return "\n".join([*told, *([f"the host's id database says {shown(entry)}"] if entry else [])]) or None


def _hint(method: str, entry: str | None) -> str:
    if method == _DATABASE and entry == "":
        return "no id database of this host knows these numbers: quote what names it, or lower the confidence below 0.5"
    if method == _DATABASE:
        return (
            "name what the entry names; where it names several products, the model needs a string of the device itself"
        )
    if method == _WEB:
        return "quote the string that the page speaks of; write into `says` the page's address and what it says of it"
    if method in _OBSERVED:
        return (
            "quote the line that says it; a word that only describes may follow in `says`; or name the kind of thing "
            "alone, or lower the confidence below 0.5"
        )
    return "quote the string that holds it, leave the word out, or lower the confidence below 0.5"
