"""Secrets that are known by their form.

A form is a chain of bounded parts, so that two expressions can be made of it: the one that finds it, and the one that
finds where it may begin when the text ends inside of it. What a stream holds back follows from the second.
"""

import base64
import json
import os
import re
from collections.abc import Iterator
from functools import cache
from urllib.parse import quote, quote_plus

from octoform.records import dataclass

_PLAIN = "A-Za-z0-9"
_TOKEN = "A-Za-z0-9_-"
_BEARER = "A-Za-z0-9._~+/=:-"
_BASE64 = "A-Za-z0-9+/"
_VALUE = r"!#-&(-+\--:<-Z\]-~"
"""The characters of a value in a header: visible, no quotes, no backslash, none of the brackets of a redaction."""
_FIRST = r"!#&(-+\--:=-Z\]-z|}~"
"""The same without the signs with which a placeholder begins."""


@dataclass(frozen=True, slots=True)
class _Part:
    """One piece of a form: the expression for all of it, and for what is there of it when the text ends inside."""

    whole: str
    begun: str


def _word(text: str, *, fold: bool = False) -> _Part:
    begun = ""
    for sign in reversed(text):
        begun = f"(?:{re.escape(sign)}{begun})?"
    return _Part(f"(?i:{re.escape(text)})", f"(?i:{begun})") if fold else _Part(re.escape(text), begun)


def _either(*words: str, fold: bool = False) -> _Part:
    parts = [_word(word, fold=fold) for word in words]
    return _Part(f"(?:{'|'.join(p.whole for p in parts)})", f"(?:{'|'.join(p.begun for p in parts)})")


def _run(signs: str, least: int, most: int | None = None) -> _Part:
    """A pattern for ``least`` to ``most`` of these characters."""
    most = most or least
    return _Part(f"[{signs}]{{{least},{most}}}", f"[{signs}]{{0,{most}}}")


@dataclass(frozen=True, slots=True, eq=False)
class Form:
    """How one kind of secret looks.

    ``anchor`` is in each of them (lower case when ``fold``), ``reach`` is how far from the beginning at most.
    ``lead`` is kept, ``secret`` replaced by ``shown``, ``tail`` kept again; ``more`` are the characters that still
    belong to the secret behind it. ``size`` is the most bytes of lead, secret and tail.
    """

    shown: str
    anchor: str
    secret: tuple[_Part, ...]
    lead: tuple[_Part, ...] = ()
    tail: tuple[_Part, ...] = ()
    more: str = ""
    fold: bool = False
    before: str = f"(?<![{_PLAIN}])"
    size: int = 128
    reach: int = 0

    def source(self) -> str:
        """The expression; its group 1 is what is replaced."""
        lead, secret, tail = ("".join(part.whole for part in parts) for parts in (self.lead, self.secret, self.tail))
        return f"{self.before}{lead}({secret}){tail}"

    def begun(self) -> str:
        """The expression for the same with its end cut off by the end of the text."""
        parts = (*self.lead, *self.secret, *self.tail)
        nested = parts[-1].begun
        for part in reversed(parts[:-1]):
            nested = f"(?:{part.begun}|{part.whole}{nested})"
        return rf"{self.before}(?:{nested})\Z"


def _token(prefix: str, least: int, signs: str = _TOKEN) -> Form:
    return Form("[token redacted]", prefix, (_word(prefix), _run(signs, least)), more=signs)


_KEY_KIND = "A-Z0-9 "
_SEPARATOR = (_run(r"\\\"'", 0, 4), _run(" \t", 0, 4), _run(":=", 1), _run(" \t", 0, 4), _run(r"\\\"'", 0, 4))
_SCHEMES = ("bearer", "basic", "token", "apikey", "negotiate", "digest")


def _payment(use: str) -> Form:
    secret = (_run("rsp", 1), _word(f"k_{use}_"), _run(_PLAIN, 12))
    return Form("[token redacted]", f"k_{use}_", secret, more=_PLAIN, reach=1)


def _lettered(prefix: str, kinds: str, end: str, least: int, signs: str) -> Form:
    return Form("[token redacted]", prefix, (_word(prefix), _run(kinds, 1), _word(end), _run(signs, least)), more=signs)


def _header(anchor: str, *names: str) -> Form:
    return Form(
        "[API key redacted]",
        anchor,
        (_run(_FIRST, 1), _run(_VALUE, 5)),
        lead=(_either(*names, fold=True), *_SEPARATOR),
        more=_VALUE,
        fold=True,
        before=f"(?<![{_TOKEN}])",
        reach=len("x-goog-"),
    )


def _key_line(shown: str, word: str) -> Form:
    kind = (_run(_KEY_KIND, 0, 40), _word("PRIVATE KEY"), _either("-----", " BLOCK-----"))
    return Form(shown, f"-----{word} ", (_word(f"-----{word} "), *kind), before="")


KEY_BEGIN = _key_line("[private key redacted]", "BEGIN")
KEY_END = _key_line("", "END")
KEY_PIECE = Form("[private key redacted]", "", (_run(_BASE64, 40),), more=f"{_BASE64}=", before=f"(?<![{_BASE64}])")
FORMS = (
    _token("sk-", 12),
    _payment("live"),
    _payment("test"),
    _lettered("gh", "pousr", "_", 16, _PLAIN),
    _token("github_pat_", 16, "A-Za-z0-9_"),
    _token("glpat-", 16),
    _token("AKIA", 16, "A-Z0-9"),
    _token("ASIA", 16, "A-Z0-9"),
    _token("AIza", 30),
    _lettered("xox", "abeoprs", "-", 10, "A-Za-z0-9-"),
    _token("hf_", 20, _PLAIN),
    _token("gsk_", 20, _PLAIN),
    _token("xai-", 20, _PLAIN),
    _token("npm_", 30, _PLAIN),
    _token("pypi-AgEI", 30),
    _token("AGE-SECRET-KEY-1", 30, "A-Z0-9"),
    Form(
        "[token redacted]",
        "eyJ",
        (_word("eyJ"), _run(_TOKEN, 8, 256), _word("."), _run(_TOKEN, 8)),
        more=f".{_TOKEN}",
        size=300,
    ),
    Form(
        "[credentials redacted]",
        "authorization",
        (_run(_BEARER, 6),),
        lead=(_word("authorization", fold=True), *_SEPARATOR, _either(*_SCHEMES, fold=True), _run(" \t", 1, 8)),
        more=_BEARER,
        fold=True,
        before="",
    ),
    Form(
        "[bearer token redacted]",
        "bearer",
        (_run(_BEARER, 16),),
        lead=(_word("bearer", fold=True), _run(" \t", 1, 8)),
        more=_BEARER,
        fold=True,
    ),
    _header("api-key", "x-api-key", "x-goog-api-key", "api-key"),
    _header("x-auth-", "x-auth-token", "x-auth-key"),
    Form(
        "[credentials redacted]",
        "://",
        (_run(r"^/\s:@'\"", 1, 64), _word(":"), _run(r"^/\s@'\"$", 1), _run(r"^/\s@'\"", 0, 256)),
        lead=(_word("://"),),
        tail=(_word("@"),),
        before="",
        size=400,
    ),
    KEY_BEGIN,
)


@cache
def _as_text(form: Form) -> re.Pattern[str]:
    return re.compile(form.source() + (f"[{form.more}]*" if form.more else ""))


def found_in(text: str) -> list[tuple[int, int]]:
    """Where something in a string shows by its form that it is a secret: (start, end) offsets, in order.

    Of a private key it is the header; `octoform.manifest.credentials.key_blocks` gives the rest.
    """
    low = text.lower()
    found = []
    for form in FORMS:
        if form.anchor in (low if form.fold else text):
            for one in _as_text(form).finditer(text):
                found.append((one.start(1), max(one.end(1), one.end() if form.more else 0)))
    return sorted(found)


# How the value of a variable looks when a program prints it.

SHORTEST = 6
"""Shorter values would blank out ordinary words and protect nothing."""
SHORTEST_BASE64 = 8


def spellings(value: str) -> list[bytes]:
    """The forms in which the value of a variable is looked for, the longest first; none for one that is too short.

    In base64 it is looked for at each of the three places that a value may have among others (``user:key``), without
    the signs at its ends that depend on its neighbours.
    """
    raw = os.fsencode(value)
    if len(raw) < SHORTEST:
        return []
    found = {raw}
    for plain in (json.dumps(value), json.dumps(value, ensure_ascii=False)):
        for once in (plain[1:-1], plain[1:-1].replace("/", "\\/")):
            found |= {os.fsencode(once), os.fsencode(json.dumps(once, ensure_ascii=False)[1:-1])}
    for encoded in (quote(raw, safe=""), quote(raw), quote_plus(raw)):
        lower = re.sub("%[0-9A-F]{2}", lambda hexadecimal: hexadecimal.group().lower(), encoded)
        found |= {encoded.encode(), lower.encode()}
    found |= {core for core in _base64_cores(raw) if len(core) >= SHORTEST_BASE64}
    return sorted(found, key=lambda form: (-len(form), form))


def _base64_cores(raw: bytes) -> Iterator[bytes]:
    for shift in range(3):
        coded = base64.b64encode(b"\0" * shift + raw)
        core = coded[(0, 2, 3)[shift] : (shift + len(raw)) * 8 // 6]
        yield core
        yield core.translate(bytes.maketrans(b"+/", b"-_"))
