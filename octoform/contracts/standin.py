"""Stand-ins for what is of one host only, in outputs that were refused.

An accepted output is hidden behind pseudonyms. A refused one cannot be: whether it is refused may depend on what a
serial number looks like and where it stands, and it need not even be JSON. So each letter and digit of such a value is
exchanged for another one, the same way wherever it is spelt, and the output is refused for the same reasons as before.
"""

import hashlib
import hmac
import json
import re
from collections.abc import Iterable

from octoform.base.files import parse
from octoform.contracts.instance import ADDRESS, MINIMUM_IN_TEXT, hidden, identifies, spelt

_PAIR = re.compile(r'"((?:[^"\\]|\\.)*)"(\s*:\s*)"((?:[^"\\]|\\.)*)"')
_MARK = re.compile("\ue0a7([0-9]{1,9})\ue0a8")


def stand_in(secret: str, key: bytes) -> str:
    """Another value of the same form: digits for digits, hexadecimal letters for such, all else but letters kept.

    The same letters and digits give the same stand-in, whatever stands between them and in whatever case.
    """
    signs = [sign for sign in secret if sign.isalnum()]
    stream = hashlib.shake_256(hmac.digest(key, "".join(signs).casefold().encode("utf-8", "replace"), "sha256"))
    drawn = iter(stream.digest(len(signs)))
    return "".join(_exchanged(sign, next(drawn)) if sign.isalnum() else sign for sign in secret)


def members(text: str) -> list[str]:
    """The values of members that name one specimen (``serial``, ``hostname``), in JSON or in what should have been."""
    found = [_value(pair[3]) for pair in _PAIR.finditer(text) if identifies(pair[1])]
    return [value.strip() for value in found if value.strip() and not hidden(value)]


def with_stand_ins(text: str, secrets: Iterable[str], key: bytes, *, in_members: bool) -> str:
    """The text with a stand-in for each of the secrets, for every hardware address and, if asked, for `members`."""
    known = set(secrets)
    stands = _Stands(key)
    if in_members:
        known |= {value for value in members(text) if len(value) >= MINIMUM_IN_TEXT and any(map(str.isdigit, value))}
        text = _PAIR.sub(stands.member, text)
    patterns = sorted((spelt(secret) for secret in known), key=lambda item: (-len(item), item))
    if patterns:
        text = re.sub("|".join(patterns), stands.hit, text, flags=re.IGNORECASE)
    return stands.put(ADDRESS.sub(stands.hit, text))


class _Stands:
    """Holds each stand-in behind a mark until the end: it has the form of a secret, and must not be exchanged again."""

    def __init__(self, key: bytes) -> None:
        self._key = key
        self._held: list[str] = []

    def hit(self, found: "re.Match[str]") -> str:
        return self._mark(stand_in(found[0], self._key))

    def member(self, pair: "re.Match[str]") -> str:
        value = _value(pair[3])
        if not identifies(pair[1]) or not value.strip() or hidden(value):
            return pair[0]
        exchanged = json.dumps(stand_in(value, self._key), ensure_ascii=False)
        return f'"{pair[1]}"{pair[2]}{self._mark(exchanged)}'

    def put(self, text: str) -> str:
        return _MARK.sub(lambda mark: self._held[int(mark[1])] if int(mark[1]) < len(self._held) else mark[0], text)

    def _mark(self, value: str) -> str:
        self._held.append(value)
        return f"\ue0a7{len(self._held) - 1}\ue0a8"


def _value(raw: str) -> str:
    try:
        value = parse(f'"{raw}"')
    except ValueError:
        return raw
    return value if isinstance(value, str) else raw


def _exchanged(sign: str, drawn: int) -> str:
    if sign.isdigit():
        return str(drawn % 10)
    letter = "abcdef"[drawn % 6] if sign.casefold() in "abcdef" else "ghijklmnopqrstuvwxyz"[drawn % 20]
    return letter.upper() if sign.isupper() else letter
