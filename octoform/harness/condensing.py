"""What a retry is told of a failed attempt's log: all of a short one, the sense of a long one.

The log itself stays as it is: it is the evidence, and only a part of it or a summary goes into a prompt. A summary is
help and never needed: whenever the model does not give one, the end of the log stands in its place.
"""

import stat
from dataclasses import dataclass, field
from pathlib import Path

from octoform.base.files import head
from octoform.diagnostics import Diagnostic
from octoform.escaping import escaped
from octoform.harness.completion import Completion, Condensed
from octoform.harness.port import Usage
from octoform.protocol.prompt import fenced, tail
from octoform.redaction import redacted

INSTRUCTION = Path(__file__).with_name("condensing.md")
BEGINNING = "WHAT FAILED"
"""How an answer begins: one that does not is a refusal, or about something else."""
HEAD_BYTES = 16 << 10
TAIL_BYTES = 48 << 10
MOST_LINES = 100


@dataclass(frozen=True, slots=True)
class Excerpt:
    """Text of at most the asked bytes, to be fenced as data like any log.

    ``condensed``: it is a model's summary; else it is the log's end, and ``reason`` says why it is when a summary was
    wanted. ``usage`` is what the summary cost.
    """

    text: str
    condensed: bool = False
    reason: str = ""
    usage: Usage = field(default_factory=Usage)


def condense(log: Path, bound_bytes: int, completion: Completion | None) -> Excerpt:
    """The log of a failed attempt in at most ``bound_bytes`` bytes; never raises for what stands in it."""
    end = tail(log, MOST_LINES, bound_bytes)
    size = _size(log)
    if completion is None or size is None or size <= bound_bytes:
        return Excerpt(end)
    answer = completion.complete(fenced("log", _shown(log, size)), INSTRUCTION.read_text(encoding="utf-8"))
    if isinstance(answer, Diagnostic):
        return Excerpt(end, reason=answer.summary)
    return _excerpt(answer, end, bound_bytes)


def _excerpt(answer: Condensed, end: str, bound: int) -> Excerpt:
    text = redacted(answer.text).strip()
    if BEGINNING not in text[: 2 * len(BEGINNING)].upper():
        return Excerpt(end, reason="the housekeeping model gave no summary of the log", usage=answer.usage)
    data = text.encode("utf-8", "replace")
    return Excerpt(data[:bound].decode("utf-8", "ignore"), condensed=True, usage=answer.usage)


def _size(log: Path) -> int | None:
    """Bytes of a plain file; None for anything else, since an agent may put a link in its place."""
    try:
        facts = log.lstat()
    except OSError:
        return None
    return facts.st_size if stat.S_ISREG(facts.st_mode) else None


def _shown(log: Path, size: int) -> str:
    """The beginning and the end of the log, redacted."""
    end = redacted(tail(log, size, TAIL_BYTES))
    if size <= TAIL_BYTES:
        return end
    beginning = redacted(_head(log, min(HEAD_BYTES, size - TAIL_BYTES)))
    left_out = max(0, size - TAIL_BYTES - HEAD_BYTES)
    return f"{beginning}\n[... {left_out} bytes left out ...]\n{end}"


def _head(log: Path, size: int) -> str:
    try:
        text = escaped(head(log, size).decode("utf-8", "replace"), "\n\t")
    except OSError:
        return ""  # gone meanwhile: the end that was read before is what there is
    return text.encode()[:size].decode("utf-8", "ignore")
