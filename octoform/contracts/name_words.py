"""Words of names and of what is cited for them: split, folded and compared as a person would read them.

Letter case, plurals, marks and the joints of compounds do not matter ("QuickCam-Pro", "quick cams pro"); digits do.
"""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from functools import lru_cache

from octoform.patterns import regex

_ESCAPE = regex(r"\\x[0-9a-f]{2}|\\u[0-9a-f]{4}|\\U[0-9a-f]{8}")
_SPREAD = regex(r"(?<=[a-z])(?=[A-Z])|(?<=[0-9])(?=[A-Z][A-Za-z])")
"""The joints of camel case; a single capital behind a digit is part of a model's number."""
_WORD = regex(r"[^\W_]+")
# Spellings in which a digit belongs to the word before or behind it, and identifies no model.
_JOINED: tuple[tuple[re.Pattern[str], str], ...] = (
    (regex(r"(?i)\bps/2\b"), "ps2"),
    (regex(r"\b([23])-?[Dd]\b"), r"\1d"),
)
_JOINED += ((regex(r"\bSoC\b"), "SOC"), (regex(r"\beMMC\b"), "EMMC"), (regex(r"\bm\.2\b", re.I), "m2"))
# The language or the meaning of a word is the reason for a name that no string holds.
_LANGUAGE = regex(
    r"(?i)\b(?:german|french|spanish|italian|portuguese|dutch|polish|czech|russian|ukrainian|chinese|japanese|korean"
    r"|turkish|arabic|hebrew|persian|swedish|danish|norwegian|finnish|hungarian|romanian|greek|hindi|thai|vietnamese"
    r"|english|translat\w*|means?)\b"
)
_PARTS = regex(r"[a-z]{3,}")
_MAX_RUN = 3


def without_escapes(text: str, joint: str = " ") -> str:
    r"""The text without what PROBE writes for characters that cannot be printed (``\x1f``): they are no words of it."""
    return _ESCAPE.sub(joint, text)


def words(text: str) -> list[str]:
    """The words of a name as they are spelt, compounds in camel case taken apart."""
    plain = unicodedata.normalize("NFKC", text)
    for spelling, joined in _JOINED:
        plain = spelling.sub(joined, plain)
    return _WORD.findall(_SPREAD.sub(" ", plain))


def word_set(texts: Iterable[str]) -> frozenset[str]:
    """Every word of the texts, also run together with its neighbours, plurals folded."""
    return frozenset().union(*map(_words_of, texts))


@lru_cache(512)
def _words_of(text: str) -> frozenset[str]:
    """Those of one text: the rules about a device ask for its texts a dozen times."""
    found = set()
    plain = unicodedata.normalize("NFKC", without_escapes(text))
    for spread in (plain, _SPREAD.sub(" ", plain)):
        spoken = [word.casefold() for word in _WORD.findall(spread)]
        for length in range(1, _MAX_RUN + 1):
            found |= {"".join(spoken[at : at + length]) for at in range(len(spoken) - length + 1)}
    return frozenset(found | {_folded(word) for word in found})


def parts(of: Iterable[str]) -> frozenset[str]:
    """The runs of letters in words: of ``arm101`` it is ``arm``."""
    return frozenset(part for word in of for part in _PARTS.findall(word))


def missing(of: Sequence[str], in_these: frozenset[str]) -> list[str]:
    """The words that are missing, plurals folded; several in a row may be one word there ('Quick Cam', 'QuickCam')."""
    folded = [word.casefold() for word in of]
    borne: set[int] = set()
    for length in range(1, _MAX_RUN + 1):
        for start in range(len(folded) - length + 1):
            run = folded[start : start + length]
            if _folded("".join(run)) in in_these or "".join(run) in in_these:
                borne.update(range(start, start + length))
    return [word for at, word in enumerate(of) if at not in borne]


def names_language(text: str) -> bool:
    """Whether a string states which language a word is of, or what it means."""
    return _LANGUAGE.search(text) is not None


def has_digit(word: str) -> bool:
    """True for a word that distinguishes one model from another."""
    return any(sign.isdigit() for sign in word)


def is_proper(word: str, name: str) -> bool:
    """A maker's or a model's word: a number, or one with a capital that does not only begin a sentence."""
    if word.isdigit() or word[1:] != word[1:].lower():
        return True
    begins = name.strip().startswith(word) and not any(each[0].isupper() for each in words(name)[1:])
    return word[0].isupper() and not begins


def _folded(word: str) -> str:
    """A word without the ending of a plural; what ends in double s is none, nor a number with a letter."""
    plural = len(word) > 3 and word.endswith("s") and not word.endswith("ss") and not word[-2].isdigit()
    return word[:-1] if plural else word


def is_misspelt(name: str, other: str) -> bool:
    """Whether two names of packages differ by their separators alone, or by one letter in a long word."""
    one, two = (re.sub(r"[-_.]", "", each) for each in (name, other))
    if one == two:
        return True
    short, long = sorted((one, two), key=len)
    if len(short) < _MIN_LETTERS or len(long) - len(short) > 1:
        return False
    at = next((place for place, pair in enumerate(zip(short, long, strict=False)) if pair[0] != pair[1]), len(short))
    changed = long[at : at + 1] + ("" if len(long) > len(short) else short[at : at + 1])
    return long[at + 1 :] == short[at + (len(long) == len(short)) :] and not changed.isdigit()


_MIN_LETTERS = 5
"""How long a name is of which a letter may be a slip."""
