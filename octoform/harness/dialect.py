"""What a program prints, as events: each program that speaks a stream of its own has a dialect in its adapter.

A dialect lives for one run and may remember what it has seen. It is fed whole lines, already redacted, of an untrusted
program: a line that it does not understand is no event and no error.
"""

import json
import re
from collections.abc import Iterable
from typing import Any, Protocol

from octoform.harness.port import AgentEvent, ExitReason, Trouble

TEXT_LIMIT = 200


class Dialect(Protocol):
    """Reads the lines of one run."""

    def read(self, stream: str, line: bytes) -> Iterable[AgentEvent]:
        """The events of one line of ``stdout`` or ``stderr``; never raises for what stands in it."""
        ...


def json_object(line: bytes) -> dict[str, Any] | None:
    """The JSON object that a line holds, or None."""
    if not line.lstrip().startswith(b"{"):
        return None
    try:
        value = json.loads(line)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def field(value: object, *path: str | int) -> Any:
    """What stands at a path of keys and indexes inside a JSON value; None when any step is not there."""
    for step in path:
        if isinstance(value, dict) and isinstance(step, str):
            value = value.get(step)
        elif isinstance(value, list) and isinstance(step, int) and -len(value) <= step < len(value):
            value = value[step]
        else:
            return None
    return value


def count(value: object, *path: str | int) -> int | None:
    """The token count at a path; None for anything but a sensible whole number."""
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
        re.compile(
            r"(?i)\b40[13]\b|unauthor|forbidden|authentication|(?:invalid|missing).{0,12}(?:api.?key|token)|"
            r"api.?key.{0,8}(?:not valid|invalid|expired)"
        ),
    ),
    (ExitReason.RATE_LIMIT, re.compile(r"(?i)\b429\b|rate.?limit|too many requests|resource.?exhausted|quota")),
    (
        ExitReason.UNREACHABLE,
        re.compile(
            r"(?i)\b5\d\d\b|overloaded|econn|enotfound|etimedout|eai_again|connect|network|fetch failed|socket|"
            r"stream (?:closed|ended|disconnected)|terminated|premature|timed? ?out|unavailable|internal.?server"
        ),
    ),
)


def trouble(text: str, status: int | None = None, *, final: bool = False) -> Trouble:
    """What a message about a failed request means; ``status`` is its HTTP status where the program tells it apart.

    A refused key is final: the next request is refused as well. What fits nothing known counts as crashed.
    """
    searched = str(status) if status is not None else text
    reason = next((reason for reason, sign in _SIGNS if sign.search(searched)), None)
    if reason is None:
        reason = next((reason for reason, sign in _SIGNS if sign.search(text)), ExitReason.CRASHED)
    return Trouble(reason, one_line(text), final or reason is ExitReason.AUTH)
