"""Parses a program's output into events: each program that speaks a stream of its own has a dialect in its adapter.

A dialect lives for one run and may remember what it has seen. It is fed whole lines, already redacted, of an untrusted
program: a line that it does not understand is no event and no error.
"""

import json
from collections.abc import Iterable
from typing import Any, Protocol

from octoform.base.files import parse
from octoform.harness.port import AgentEvent, ExitReason, ModelProblem
from octoform.patterns import regex

TEXT_LIMIT = 200


class Dialect(Protocol):
    """Reads the lines of one run."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """The events of one line of ``stdout`` or ``stderr``; never raises for what is in it."""
        ...


def json_object(line: bytes) -> dict[str, Any] | None:
    """The JSON object that a line holds, or None."""
    if not line.lstrip().startswith(b"{"):
        return None
    try:
        value = parse(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def field(value: object, *path: str | int) -> Any:
    """The value at a path of keys and indexes inside a JSON value; None when any step is not there."""
    for step in path:
        if isinstance(value, dict) and isinstance(step, str):
            value = value.get(step)
        elif isinstance(value, list) and isinstance(step, int) and -len(value) <= step < len(value):
            value = value[step]
        else:
            return None
    return value


def count(value: object, *path: str | int) -> int | None:
    """The token count at a path; None for anything but a sensible integer."""
    found = field(value, *path)
    return found if isinstance(found, int) and not isinstance(found, bool) and 0 <= found < 1 << 53 else None


def one_line(value: object) -> str:
    """A string (or any JSON value) as one printable line of bounded length, for progress and the transcript."""
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    text = " ".join(text[: 4 * TEXT_LIMIT].split())
    return "".join(sign if sign.isprintable() else "\ufffd" for sign in text)[:TEXT_LIMIT]


_SIGNS = (
    (
        ExitReason.AUTH,
        regex(
            r"(?i)\b40[13]\b|unauthor|forbidden|authentication|(?:invalid|missing).{0,12}(?:api.?key|token\b)|"
            r"api.?key.{0,8}(?:not valid|invalid|expired)"
        ),
    ),
    (
        ExitReason.REFUSED,
        regex(
            r"(?i)(?:^|status(?: code)?:? |\"code\": ?|error:? |http )40[024]\b|payment.?required|"
            r"insufficient.{0,3}(?:credit|quota|funds|balance)|credit balance|"
            r"(?:unknown|unsupported|no such|invalid|not a valid).{0,3}model\b|"
            r"\bmodels?\b.{0,80}(?:not.?found|does(?: not|n't) exist|not (?:a )?(?:supported|valid|available))"
        ),
    ),
    (ExitReason.RATE_LIMIT, regex(r"(?i)\b429\b|rate.?limit|too many requests|resource.?exhausted|quota")),
    (
        ExitReason.UNREACHABLE,
        regex(
            r"(?i)\b5\d\d\b|overloaded|econn|enotfound|etimedout|eai_again|connect|network|fetch failed|socket|"
            r"stream (?:closed|ended|disconnected)|terminated|premature|timed? ?out|unavailable|internal.?server"
        ),
    ),
)
REFUSALS = (400, 402, 404)
_TOO_LONG = regex(r"(?i)context|too (?:long|large|many tokens)|maximum.{0,20}tokens")
"""A conversation that has grown too long is one run's own doing; the next one may well do better."""


def problem(text: str, status: int | None = None, *, final: bool = False) -> ModelProblem:
    """The problem in a message about a failed request; ``status`` is its HTTP status where the program reports one.

    A refused key is final, and so is a request that is never taken: the next one is refused as well. What fits nothing
    known counts as crashed.
    """
    reason = _reason(text, status)
    return ModelProblem(reason, one_line(text), final or reason in (ExitReason.AUTH, ExitReason.REFUSED))


def _reason(text: str, status: int | None) -> ExitReason:
    found = _reason_of(text)
    if status in REFUSALS:
        # Some services call a wrong key a bad request.
        found = found if found is ExitReason.AUTH else ExitReason.REFUSED
    elif status is not None:
        found = _reason_of(str(status)) or found
    if found is ExitReason.REFUSED and _TOO_LONG.search(text):
        return ExitReason.CRASHED
    return found or ExitReason.CRASHED


def _reason_of(text: str) -> ExitReason | None:
    return next((reason for reason, sign in _SIGNS if sign.search(text)), None)
