"""A secret must not come out of an attempt: outputs are committed, diagnostics reach prompts, records and the state.

Text has more than one spelling: JSON writes any letter as ``\\uXXXX``, and octoform would write it out in clear when
it accepts the value. So the output is also read as the value that it stands for. What an agent was given is known by
its value, anything else by its form alone (a bearer token, a private key, a well-known token).
"""

import ast
import json
from collections.abc import Iterable, Iterator, Mapping
from itertools import islice
from typing import Any

from octoform.base.files import parse
from octoform.base.shape import step
from octoform.diagnostics import Diagnostic, Span, error, warning
from octoform.harness.containment import agent_environment
from octoform.harness.port import Task
from octoform.patterns import regex
from octoform.records import replace
from octoform.redaction import found_in, redacted, spellings

SHORTEST = 8
"""Shorter values are ordinary words (``debug``, ``C.UTF-8``) that an honest output may hold."""
MAX_PLACES = 10
_HEADER = "-----BEGIN"
_KEY_MATERIAL = regex(r"[A-Za-z0-9+/]{32}")
_HINT = "an agent must not hand over what one logs in with; the output was taken out of the attempt's folder"


def leaked(task: Task, data: bytes) -> list[Diagnostic]:
    """An error for each secret that is in an output, however it is spelt; the secret itself is not shown."""
    lines = [("", data.decode("utf-8", "replace")), *_readings(task.stage, data)]
    return [*_given_in(task, lines), *_looking_like_one(task, lines)]


def masked(task: Task, data: bytes) -> tuple[bytes, list[Diagnostic]]:
    """PROBE's output with everything blanked out that looks like a secret, and a warning for each such place.

    PROBE copies what devices say of themselves, and a device may call itself whatever it likes: that must neither
    reach git nor keep a host from being onboarded. Any other stage's output is given back as it is.
    """
    value = _value(data) if task.stage == "probe" else None
    places = [place for place, text in _strings(value, "") if _shows_one(text)]
    if not places:
        return data, []
    lines = [
        warning(
            "APPLY-CREDENTIAL-IN-OUTPUT",
            "a device's text looks like a token, a key or a password; it is blanked out",
            pointer=place,
            hint="if it is a real one, it is readable by everybody who can use this machine",
        )
        for place in places[:MAX_PLACES]
    ]
    return json.dumps(blanked(value), ensure_ascii=False).encode("utf-8", "surrogatepass"), lines


def blanked(value: Any) -> Any:
    """A value with everything blanked out that looks like a secret, as `masked` does it."""
    if isinstance(value, str):
        return redacted(value) if _shows_one(value) else value
    if isinstance(value, dict):
        return {key: blanked(item) for key, item in value.items()}
    return [blanked(item) for item in value] if isinstance(value, list) else value


def without_secrets(task: Task, items: Iterable[Diagnostic]) -> tuple[Diagnostic, ...]:
    """Diagnostics as they may be kept and shown: what they quote of an agent is redacted, as its log is."""
    secrets = agent_environment.secrets(task.environment, task.secrets)

    def clean(text: str | None) -> str | None:
        return None if text is None else redacted(text, secrets)

    return tuple(
        replace(
            item,
            summary=redacted(item.summary, secrets),
            path=clean(item.path),
            source=clean(item.source),
            pointer=clean(item.pointer),
            detail=clean(item.detail),
            hint=clean(item.hint),
        )
        for item in items
    )


def _given_in(task: Task, said: list[tuple[str, str]]) -> list[Diagnostic]:
    texts = [text.encode("utf-8", "surrogatepass") for _, text in said]
    return [
        error("APPLY-SECRET-IN-OUTPUT", f"the output of {task.stage} holds the value of {name}", hint=_HINT)
        for name, value in _given(task).items()
        if any(form in text for form in spellings(value) for text in texts)
    ]


def _given(task: Task) -> Mapping[str, str]:
    values = {name: task.environment.get(name, "") for name in task.secrets}
    return {name: value for name, value in values.items() if len(value) >= SHORTEST}


def _looking_like_one(task: Task, texts: list[tuple[str, str]]) -> list[Diagnostic]:
    """Where something looks like a secret; the text as a whole only counts where no part of it does."""
    places = list(islice((place for place, text in texts[1:] if place and _shows_one(text)), MAX_PLACES))
    if not places and not _shows_one(texts[0][1]):
        return []
    return [
        error(
            "APPLY-CREDENTIAL-IN-OUTPUT",
            f"the output of {task.stage} holds what looks like a token, a key or a password",
            hint=_HINT,
            **({"span": Span(int(place), 1)} if place.isdecimal() else {"pointer": place or None}),
        )
        for place in places or [""]
    ]


def _shows_one(text: str) -> bool:
    return any(_is_credible(text, start, end) for start, end in found_in(text))


def _is_credible(text: str, start: int, end: int) -> bool:
    """A device may call itself the first line of a key, and code may name where a key comes from."""
    if text.startswith(_HEADER, start):
        return _KEY_MATERIAL.search(text, end, end + 400) is not None
    return text.endswith("://", 0, start) or any(sign.isdigit() for sign in text[start:end])


def _readings(stage: str, data: bytes) -> Iterator[tuple[str, str]]:
    """The texts that an output stands for, each with its place: a JSON pointer, or a line of a program."""
    return _literals(data) if stage == "serve" else _strings(_value(data), "")


def _value(data: bytes) -> Any:
    try:
        return parse(data)
    except ValueError:
        return None  # the gate refuses it as no JSON; its bytes are looked at all the same


def _strings(value: Any, pointer: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, str):
        yield pointer, value
    elif isinstance(value, dict):
        for key, item in value.items():
            place = f"{pointer}/{step(key)}"
            yield place, key
            yield from _strings(item, place)
    elif isinstance(value, list):
        for number, item in enumerate(value):
            yield from _strings(item, f"{pointer}/{number}")


def _literals(data: bytes) -> Iterator[tuple[str, str]]:
    try:
        tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # the gate refuses it as no Python
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes):
            text = node.value if isinstance(node.value, str) else node.value.decode("utf-8", "replace")
            yield str(node.lineno), text
