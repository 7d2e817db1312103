"""From the bytes that an agent left behind to a value, strictly.

Ordinary JSON readers keep the last of two equal keys, read NaN, and run out of stack on a deep document; each of
these has let a broken artifact pass as a good one somewhere. The good case costs one pass of the C decoder; only a
refused document is scanned again, for the place of the mistake.
"""

import json
import math
import re
from collections.abc import Iterator
from typing import Any

from octoform.base.escaping import display, flattened
from octoform.diagnostics import Diagnostic, Span, error
from octoform.patterns import regex

MAX_JSON_BYTES = 8 * 1024 * 1024
MAX_SOURCE_BYTES = 256 * 1024
MAX_DEPTH = 64
MAX_DIGITS = 40
_MAX_SOURCE_SHOWN = 200

_TOKEN = regex(r'"[^"\\]*(?:\\.[^"\\]*)*"|-?[0-9][0-9.eE+-]*|-?[A-Za-z]+|[{}\[\],:]', re.DOTALL)
_SURROGATE_ESCAPE = regex(r"\\u[dD][89a-fA-F]")


class _Refused(Exception):
    """Leaves the decoder at the first thing that strict JSON does not have."""


def parse(stage: str, data: bytes, path: str) -> tuple[object | None, list[Diagnostic]]:
    """The value that ``data`` holds, or None and what is wrong with it.

    ``serve`` gives the source text, every other stage a JSON value. ``path`` is only named in diagnostics. Never
    raises, whatever the bytes.
    """
    limit = MAX_SOURCE_BYTES if stage == "serve" else MAX_JSON_BYTES
    if len(data) > limit:
        summary = f"the artifact has {len(data)} bytes; at most {limit} are read"
        return None, [error("ARTIFACT-TOO-LARGE", summary, path=path, hint="write less: no logs, no binary data")]
    text, problem = _decode(data, path)
    if text is None:
        return None, [problem] if problem else []
    if not text.strip():
        what = "is empty" if not data else "holds nothing but white space"
        return None, [error("ARTIFACT-EMPTY", f"the artifact {what}", path=path, hint="write the whole artifact")]
    if stage == "serve":
        return text, []
    return _read_json(text, path)


def _decode(data: bytes, path: str) -> tuple[str | None, Diagnostic | None]:
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as problem:
        before = data[: problem.start].decode("utf-8")
        span, source = _place(before + "\ufffd", len(before))
        summary = f"the artifact is not UTF-8: byte 0x{data[problem.start]:02x} at offset {problem.start}"
        hint = "write the file as UTF-8 without other encodings in it"
        return None, error("ARTIFACT-NOT-UTF8", summary, path=path, span=span, source=source, hint=hint)
    if text.startswith("\ufeff"):
        return None, error(
            "ARTIFACT-NOT-UTF8",
            "the artifact starts with a byte order mark",
            path=path,
            span=Span(1, 1),
            hint="write UTF-8 without a byte order mark",
        )
    return text, None


def _read_json(text: str, path: str) -> tuple[object | None, list[Diagnostic]]:
    try:
        value = json.loads(text, object_pairs_hook=_object, parse_constant=_refuse, parse_float=_float, parse_int=_int)
    except json.JSONDecodeError as problem:
        span, source = _place(text, problem.pos)
        summary = f"the artifact is not JSON: {problem.msg}"
        hint = "write one complete JSON document and nothing else: no comments, no code fences, no trailing commas"
        return None, [error("ARTIFACT-NOT-JSON", summary, path=path, span=span, source=source, hint=hint)]
    except (_Refused, RecursionError):
        return None, [_locate(text, path)]
    if deeper_than(value, MAX_DEPTH) or (_SURROGATE_ESCAPE.search(text) and _has_lone_surrogate(value)):
        return None, [_locate(text, path)]
    return value, []


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise _Refused
    return value


def _refuse(name: str) -> float:
    raise _Refused(name)


def _float(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise _Refused(digits)
    return value


def _int(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise _Refused(digits)
    return int(digits)


def deeper_than(value: object, limit: int) -> bool:
    """True when lists and objects in a JSON value are nested more than ``limit`` levels deep."""
    level = [value] if isinstance(value, (dict, list)) else []
    for _ in range(limit):
        if not level:
            return False
        inside = (item.values() if isinstance(item, dict) else item for item in level)
        level = [item for items in inside for item in items if isinstance(item, (dict, list))]
    return bool(level)


def _has_lone_surrogate(value: object) -> bool:
    try:
        json.dumps(value, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError:
        return True
    return False


def _locate(text: str, path: str) -> Diagnostic:
    """The place of the first thing that the strict reader refused; ``text`` is otherwise well-formed JSON."""
    for start, code, summary, hint in _refusals(text):
        span, source = _place(text, start)
        return error(code, summary, path=path, span=span, source=source, hint=hint)
    return error("ARTIFACT-NOT-JSON", "the artifact is not JSON that can be read", path=path)


def _refusals(text: str) -> Iterator[tuple[int, str, str, str]]:
    """(offset, code, summary, hint) of each refusal, in the order of the text."""
    keys: list[set[str] | None] = []
    previous = ""
    for match in _TOKEN.finditer(text):
        token = match.group()
        if token in "{[":
            keys.append(set() if token == "{" else None)
            if len(keys) > MAX_DEPTH:
                hint = "artifacts are flat; nothing in them needs such depth"
                yield match.start(), "ARTIFACT-TOO-DEEP", f"nested deeper than {MAX_DEPTH} levels", hint
        elif token in "}]":
            if keys:
                keys.pop()
        elif token.startswith('"'):
            yield from _string_refusals(token, match.start(), keys, previous)
        else:
            yield from _number_refusals(token, match.start())
        previous = token


def _string_refusals(
    token: str, start: int, keys: list[set[str] | None], previous: str
) -> Iterator[tuple[int, str, str, str]]:
    word = _decoded(token)
    seen = keys[-1] if keys else None
    if seen is not None and previous in ("{", ","):
        if word in seen:
            hint = "keep one of the two; a reader that keeps the last one would lose the first"
            yield start, "ARTIFACT-DUPLICATE-KEY", f"the key {display(word)} is twice in one object", hint
        seen.add(word)
    if any("\ud800" <= item <= "\udfff" for item in word):
        hint = "write the character itself, or both halves of its surrogate pair"
        yield start, "ARTIFACT-LONE-SURROGATE", "a string holds half of a surrogate pair", hint


def _number_refusals(token: str, start: int) -> Iterator[tuple[int, str, str, str]]:
    hint = "JSON has finite numbers only; leave a value that is not known out"
    if token.lstrip("-") in ("NaN", "Infinity"):
        yield start, "ARTIFACT-BAD-NUMBER", f"{token} is not a JSON number", hint
    elif token[-1].isdigit() and (token[0].isdigit() or token[0] == "-"):
        whole = token.lstrip("-").isdigit()
        if (whole and len(token) > MAX_DIGITS) or (not whole and not math.isfinite(float(token))):
            yield start, "ARTIFACT-BAD-NUMBER", f"the number {display(token, 30)} is out of range", hint


def _decoded(token: str) -> str:
    try:
        word = json.loads(token)
    except json.JSONDecodeError:
        return token
    return str(word)


def _place(text: str, offset: int) -> tuple[Span, str | None]:
    """Line and column of an offset, and the line's text where its bounded form still shows that column.

    Hidden characters become one visible character each, so that columns stay true.
    """
    start = text.rfind("\n", 0, offset) + 1
    end = text.find("\n", offset)
    line = text[start:] if end < 0 else text[start:end]
    span = Span(text.count("\n", 0, offset) + 1, offset - start + 1)
    if span.column > _MAX_SOURCE_SHOWN:
        return span, None
    return span, flattened(line[:_MAX_SOURCE_SHOWN].rstrip("\r"))
