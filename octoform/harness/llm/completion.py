"""The second port to a model: one bare completion with a cap, for housekeeping between the attempts of agents.

It has no tools and decides nothing; where it fails, its caller does without. Like every use of a model it runs as a
process of its own below containment, so it is bounded in time whatever the library does.
"""

import json
import stat
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Protocol

from octoform.base.escaping import escaped
from octoform.base.files import head, replace
from octoform.diagnostics import Diagnostic, warning
from octoform.harness.containment import agent_environment
from octoform.harness.containment.contained_run import Ended, Limits, Program, run
from octoform.harness.event_parser import count, json_object, one_line
from octoform.harness.event_parser import field as at
from octoform.harness.event_parser import problem as model_problem
from octoform.harness.llm.client import BACKOFF_SECONDS, SETTINGS
from octoform.harness.llm.route import HARNESS, Route, route
from octoform.harness.port import Excerpt, ExitReason, Usage
from octoform.manifest.model import HarnessSpec, Housekeeping
from octoform.manifest.references import resolve
from octoform.protocol.prompt import fenced, tail
from octoform.records import dataclass, field
from octoform.redaction import redacted

MODULE = "octoform.harness.llm.bare"
SECONDS = 60.0
BYTES_PER_TOKEN = 4
ANSWER_BYTES = 1 << 20
CODE = "HOUSEKEEPING-FAILED"


@dataclass(frozen=True, slots=True)
class Condensed:
    """The model's answer, at most its cap long; ``cut`` when it was longer."""

    text: str
    usage: Usage = field(default_factory=Usage)
    cut: bool = False


class Completion(Protocol):
    """Answers one text after one instruction."""

    def complete(self, text: str, instruction: str) -> Condensed | Diagnostic:
        """The answer, or why there is none; blocking and bounded. ``text`` is data, already bounded and redacted."""
        ...


@dataclass(frozen=True, slots=True)
class LiteLLMCompletion:
    """A completion by litellm with the manifest's ``housekeeping``; ``environ`` is what the caller has.

    ``seconds`` bound all of it: the start of the process, the retries, the answer.
    """

    settings: Housekeeping
    environ: Mapping[str, str]
    seconds: float = SECONDS
    backoff_seconds: float = BACKOFF_SECONDS

    def complete(self, text: str, instruction: str) -> Condensed | Diagnostic:
        """See `Completion.complete`."""
        spec = HarnessSpec(HARNESS, key=self.settings.key, base_url=self.settings.base_url)
        way = route(spec, resolve(self.settings.model, self.environ), self.environ)
        if isinstance(way, Diagnostic):
            return way
        if way.key and not self.environ.get(way.key):
            return _failed(f"the variable {way.key} with its key is not set")
        question = {
            "route": asdict(way),
            "text": text,
            "instruction": instruction,
            "max_tokens": self.settings.max_tokens,
            "seconds": self.seconds,
            "backoff_seconds": self.backoff_seconds,
        }
        began = time.monotonic()
        try:
            with tempfile.TemporaryDirectory(prefix="octoform-") as folder:
                ended, found = self._ask(Path(folder), way, json.dumps(question))
        except OSError as problem:
            return _failed(f"its process could not be run: {problem.strerror}")
        return self._answer(ended, found, time.monotonic() - began)

    def _ask(self, folder: Path, way: Route, question: str) -> tuple[Ended, bytes]:
        asked, found = folder / "question.json", _Kept()
        replace(asked, question.encode(), 0o644, synced=False)
        named = (way.key,) if way.key else ()
        program = Program(
            argv=(sys.executable, "-I", "-W", "ignore", "-m", MODULE),
            workdir=folder,
            environment={**agent_environment.minimal(folder, self.environ, named), **SETTINGS},
            log=folder / "completion.log",
            stdin=asked,
            secrets=agent_environment.secrets(self.environ, named),
        )
        return run(program, Limits(wall_seconds=self.seconds), found), bytes(found.data)

    def _answer(self, ended: Ended, output: bytes, seconds: float) -> Condensed | Diagnostic:
        if ended.reason == "wall":
            return _failed(f"no answer within {self.seconds:g} s")
        lines = output.splitlines()
        value = json_object(lines[-1]) if lines else None
        if value is None:
            return _failed(f"its process ended without an answer after {seconds:.0f} s (status {ended.status})")
        if at(value, "failed") is not None:
            found = model_problem(one_line(at(value, "failed")), count(value, "status"))
            return _failed(f"{_WORDS.get(found.reason, 'the request failed')}: {found.text}")
        text = str(at(value, "text") or "").strip()
        if not text:
            return _failed(f"the model answered nothing (it ended with {one_line(at(value, 'end'))})")
        return self._capped(text, value)

    def _capped(self, text: str, value: Mapping[str, Any]) -> Condensed:
        limit = self.settings.max_tokens * BYTES_PER_TOKEN
        data = text.encode("utf-8", "replace")
        used = [count(value, "usage", name) for name in ("input", "cached", "output")]
        cut = len(data) > limit or at(value, "end") == "length"
        return Condensed(data[:limit].decode("utf-8", "ignore"), Usage(used[0], used[1], used[2]), cut)


_WORDS = {
    ExitReason.AUTH: "the key was refused",
    ExitReason.REFUSED: "the request was refused",
    ExitReason.RATE_LIMIT: "the model's rate limit is reached",
    ExitReason.UNREACHABLE: "the model cannot be reached",
}


def _failed(why: str) -> Diagnostic:
    return warning(
        CODE, f"the housekeeping model gave no answer: {why}", hint="the end of the log is used as it is instead"
    )


class _Kept:
    """Keeps what the process reports, within a bound."""

    def __init__(self) -> None:
        self.data = bytearray()

    def feed(self, stream: str, data: bytes) -> None:
        """See `Observer.feed`."""
        if stream == "stdout":
            self.data += data[: max(0, ANSWER_BYTES - len(self.data))]

    def tick(self) -> bool:
        """See `Observer.tick`."""
        return False

    def finish(self) -> None:
        """See `Observer.finish`."""


# The excerpt of a failed attempt's log that a retry gets: all of a short one, the sense of a long one.
#
# The log itself stays as it is: it is the evidence, and only a part of it or a summary goes into a prompt. A summary is
# help and never needed: whenever the model does not give one, the end of the log replaces it.

INSTRUCTION = Path(__file__).with_name("log_summary.md")
BEGINNING = "WHAT FAILED"
"""How an answer begins: one that does not is a refusal, or about something else."""
HEAD_BYTES = 16 << 10
TAIL_BYTES = 48 << 10
MAX_LINES = 100


def condense(log: Path, bound_bytes: int, completion: Completion | None) -> Excerpt:
    """The log of a failed attempt in at most ``bound_bytes`` bytes; never raises for what is in it."""
    end = tail(log, MAX_LINES, bound_bytes)
    size = _size(log)
    if completion is None or size is None or size <= bound_bytes:
        return Excerpt(end)
    answer = completion.complete(fenced("log", _log_excerpt(log, size)), INSTRUCTION.read_text(encoding="utf-8"))
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


def _log_excerpt(log: Path, size: int) -> str:
    """The beginning and the end of the log, redacted."""
    end = redacted(tail(log, size, TAIL_BYTES))
    if size <= TAIL_BYTES:
        return end
    beginning = redacted(_head(log, min(HEAD_BYTES, size - TAIL_BYTES)))
    left_out = max(0, size - TAIL_BYTES - HEAD_BYTES)
    return f"{beginning}\n[... {left_out} bytes omitted ...]\n{end}"


def _head(log: Path, size: int) -> str:
    try:
        text = escaped(head(log, size).decode("utf-8", "replace"), "\n\t")
    except OSError:
        return ""  # gone meanwhile: the end that was read before is what there is
    return text.encode()[:size].decode("utf-8", "ignore")
