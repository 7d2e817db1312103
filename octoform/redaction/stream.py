"""Redaction of a stream that comes in pieces of any size; the result does not depend on where it was cut.

At each place it is decided what is there only when nothing that may still come can change it. What follows the
first few characters of a secret is dropped as it comes and never held.
"""

import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import NamedTuple, Protocol

from octoform.patterns import regex
from octoform.redaction.forms import FORMS, KEY_BEGIN, KEY_END, KEY_PIECE, Form, spellings

WARY_BYTES = 16 << 10
"""How far behind a private key that was left without its end line pieces of a key are still looked for."""
BEHIND_KEY = ("end", "piece")
_IN_KEY = regex(rb"[A-Za-z0-9+/=\\ \t\r\n:,-]*")


class _Text(NamedTuple):
    """A string, and the same in lower case."""

    plain: bytes
    low: bytes


class _Hit(NamedTuple):
    """A secret in a string: where what shows it begins, where it begins itself, where it ends."""

    start: int
    secret: int
    end: int


class _Finder(Protocol):
    """Finds one kind of secret; ``anchor`` is in each (in lower case when ``fold``).

    ``more`` is the expression of what still belongs to one behind its end. ``kind`` is ``key`` for the first line of
    a private key, ``end`` and ``piece`` for what is looked for behind one.
    """

    shown: bytes
    anchor: bytes
    fold: bool
    more: str
    kind: str

    def search(self, text: _Text, start: int) -> _Hit | None:
        """The next one."""
        ...

    def cut_off(self, text: bytes, start: int) -> int | None:
        """Where one may begin whose rest is still to come."""
        ...


class _FormFinder:
    """Finds what a form describes."""

    def __init__(self, form: Form, kind: str = "") -> None:
        self.shown = form.shown.encode()
        self.anchor = form.anchor.encode()
        self.fold = form.fold
        self.more = f"[{form.more}]*" if form.more else ""
        self.kind = kind
        self._size, self._reach = form.size, form.reach
        self._direct = not form.anchor or not (form.before or form.fold)
        self._whole, self._begun = form.source(), form.begun()

    def search(self, text: _Text, start: int) -> _Hit | None:
        """See `_Finder.search`; looking for the fixed word first is many times as fast as most expressions alone."""
        whole, at = _compiled(self._whole), start
        if self._direct:
            found = whole.search(text.plain, start)
            return _Hit(found.start(), found.start(1), found.end(1)) if found is not None else None
        while (at := (text.low if self.fold else text.plain).find(self.anchor, at)) >= 0:
            for begin in range(max(start, at - self._reach), at + 1):
                if (found := whole.match(text.plain, begin)) is not None:
                    return _Hit(begin, found.start(1), found.end(1))
            at += 1
        return None

    def cut_off(self, text: bytes, start: int) -> int | None:
        """See `_Finder.cut_off`."""
        found = _compiled(self._begun).search(text, max(start, len(text) - self._size))
        return found.start() if found is not None and found.start() < len(text) else None


class _ValueFinder:
    """Finds one spelling of a value."""

    fold = False
    more = ""
    kind = ""

    def __init__(self, name: str, form: bytes) -> None:
        self.shown = f"[{name} redacted]".encode()
        self.anchor = form

    def search(self, text: _Text, start: int) -> _Hit | None:
        """See `_Finder.search`."""
        at = text.plain.find(self.anchor, start)
        return _Hit(at, at, at + len(self.anchor)) if at >= 0 else None

    def cut_off(self, text: bytes, start: int) -> int | None:
        """See `_Finder.cut_off`."""
        start = max(start, len(text) - len(self.anchor) + 1)
        while (start := text.find(self.anchor[:1], start)) >= 0:
            if self.anchor.startswith(text[start:]):
                return start
            start += 1
        return None


@cache
def _compiled(source: str) -> re.Pattern[bytes]:
    return re.compile(source.encode("ascii"))


def _end_of(pattern: re.Pattern[bytes], text: bytes, start: int) -> int:
    found = pattern.match(text, start)
    return found.end() if found is not None else start


@cache
def _key_end() -> _FormFinder:
    return _FormFinder(KEY_END, "end")


@cache
def _form_finders() -> tuple[_Finder, ...]:
    plain = [_FormFinder(form, "key" if form is KEY_BEGIN else "") for form in FORMS]
    return (_key_end(), _FormFinder(KEY_PIECE, "piece"), *plain)


def _value_finders(secrets: Mapping[str, str]) -> list[_ValueFinder]:
    found = [_ValueFinder(name, form) for name, value in secrets.items() for form in spellings(value)]
    return sorted(found, key=lambda finder: -len(finder.anchor))


class Redactor:
    """Takes the secrets out of one stream of bytes; ``secrets`` are values by the name that is shown instead.

    The joined results of `feed` and `flush` are the same however the stream was cut. What could be the beginning of a
    secret is held back, at most as many bytes as the longest value and never more than a few hundred otherwise;
    nothing is held back behind a line end unless a value holds one.
    """

    def __init__(self, secrets: Mapping[str, str] | None = None) -> None:
        values = _value_finders(secrets or {})
        self.finders = (*values, *_form_finders())
        self.over_lines = tuple(finder for finder in values if b"\n" in finder.anchor)
        self._before = b""
        self._held = b""
        self._seen = 0
        self.dropping = ""
        self.wary_until = 0

    def feed(self, data: bytes) -> bytes:
        """The next piece as it may be written."""
        return self._take(data, last=False) if data else b""

    def flush(self) -> bytes:
        """The bytes that were held back, at the end of the stream."""
        return self._take(b"", last=True)

    def end(self, data: bytes) -> bytes:
        """The last piece, or all of a string: nothing comes of which a part could be held back."""
        return self._take(data, last=True)

    def _take(self, data: bytes, *, last: bool) -> bytes:
        text = self._before + self._held + data
        piece = _Piece(self, text, len(self._before), self._seen - len(self._before), last)
        piece.work()
        self._before, self._held = text[max(0, piece.at - 1) : piece.at], text[piece.at :]
        self._seen = piece.base + piece.at
        return b"".join(piece.out)


class _Piece:
    """The work on one piece of a stream: ``at`` is how far it has come, ``base`` the stream's offset of its text."""

    def __init__(self, stream: Redactor, text: bytes, at: int, base: int, last: bool) -> None:
        self.stream = stream
        self.text = text
        self.at = at
        self.base = base
        self.last = last
        self.out: list[bytes] = []
        self._both = both = _Text(text, text.lower())
        self._present = [item for item in stream.finders if item.anchor in (both.low if item.fold else text)]
        self._next: dict[_Finder, _Hit | None] = {}
        self._holds: dict[bool, int] = {}

    def work(self) -> None:
        """Go through the text as far as it is decided."""
        while self.at < len(self.text):
            if self.stream.dropping:
                if not self._drop():
                    return
                continue
            hold = self._hold()
            found = list(self._found())
            first = min(found, key=lambda item: item[0].secret, default=None)
            if first is None or first[0].secret >= hold:
                self._pass(min([hold, *(hit.start for hit, _ in found)]))
                return
            self._replace(*first)

    def _pass(self, end: int) -> None:
        self.out.append(self.text[self.at : end])
        self.at = end

    def _replace(self, hit: _Hit, finder: _Finder) -> None:
        self._pass(hit.secret)
        self.out.append(finder.shown)
        self.at = hit.end
        self.stream.dropping = "key" if finder.kind == "key" else finder.more
        if finder.kind == "end":
            self.stream.wary_until = 0

    def _drop(self) -> bool:
        """Drop what belongs to a secret; False when the text ends before it does."""
        if self.stream.dropping == "key":
            return self._drop_key()
        self.at = _end_of(_compiled(self.stream.dropping), self.text, self.at)
        if self.at < len(self.text):
            self.stream.dropping = ""
        return self.at < len(self.text)

    def _drop_key(self) -> bool:
        """A key goes to its end line, or to what cannot be in one (the quote of a JSON string, say).

        From there pieces of it are looked for a while longer: its lines may be quoted one by one.
        """
        inside = self.text[self.at : _end_of(_IN_KEY, self.text, self.at)]
        end = self.at + len(inside)
        closing = _key_end().search(_Text(inside, inside), 0)
        if closing is not None:
            self.at, self.stream.dropping = self.at + closing.end, ""
            return True
        if end < len(self.text):
            self.at, self.stream.dropping = end, ""
            self.stream.wary_until = self.base + end + WARY_BYTES
            return True
        begun = None if self.last else _key_end().cut_off(self.text, self.at)
        self.at = len(self.text) if begun is None else begun
        return False

    def _found(self) -> Iterator[tuple[_Hit, _Finder]]:
        """The next match of each finder: values first, the longest of them before all."""
        for finder in self._present:
            if finder.kind in BEHIND_KEY and not self._wary(self.at):
                continue
            hit = self._next.get(finder)
            if finder not in self._next or (hit is not None and hit.start < self.at):
                hit = self._next[finder] = finder.search(self._both, self.at)
            if hit is not None and (finder.kind not in BEHIND_KEY or self._wary(hit.start)):
                yield hit, finder

    def _wary(self, at: int) -> bool:
        return self.base + at < self.stream.wary_until

    def _hold(self) -> int:
        """From where on nothing is decided: something may begin there whose rest is still to come."""
        wary = self._wary(self.at)
        if self._holds.get(wary, -1) < self.at:
            self._holds[wary] = len(self.text) if self.last else self._cut_off(wary)
        return self._holds[wary]

    def _cut_off(self, wary: bool) -> int:
        size = len(self.text)
        line = max(self.at, self.text.rfind(b"\n", self.at) + 1)
        finders = self.stream.finders if line < size else ()
        holds = [item.cut_off(self.text, line) for item in finders if wary or item.kind not in BEHIND_KEY]
        holds += [item.cut_off(self.text, self.at) for item in self.stream.over_lines]
        return min((hold for hold in holds if hold is not None), default=size)


def redacted(text: str, secrets: Mapping[str, str] | None = None) -> str:
    """A whole text without its secrets."""
    return Redactor(secrets).end(text.encode("utf-8", "surrogatepass")).decode("utf-8", "surrogatepass")
