"""The watcher of one run: what the agent does while it does it, what it has used, and when it has to end.

Programs bound neither their retries nor their loops, and few of them a stalled reply. So the orchestrator reads along:
it counts replies and money, notices when nothing moves any more, and remembers what the model's side last complained
of, so that a run that came to nothing gets the reason that a person can act on.
"""

import json
import os
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

from octoform.harness.containment.task_log import Progress
from octoform.harness.event_parser import Dialect, one_line
from octoform.harness.llm.token_prices import OWNERS, cost_of
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    Price,
    ProgressSink,
    Replying,
    TaskLimits,
    ToolCalled,
    ToolReturned,
    Totals,
    Turn,
    Usage,
)
from octoform.redaction import redacted

CLOSING_SECONDS = 10.0
"""How long a program may take to leave after it has reported that its run is over."""
MAX_LINE = 8 << 20
TRANSCRIPT_BYTES = 4 << 20
KINDS = {
    Output: "said",
    ToolCalled: "tool_called",
    ToolReturned: "tool_returned",
    Turn: "turn",
    Totals: "totals",
    ModelProblem: "trouble",
    Closed: "closed",
}


@dataclass(slots=True)
class _Seen:
    """The observations of the run so far; times are seconds of the watcher's clock."""

    active: float
    turns: int = 0
    usage: Usage = field(default_factory=Usage)
    totals: Usage | None = None
    problem: ModelProblem | None = None
    trouble_since: float = 0.0
    closed: Closed | None = None
    closed_at: float = 0.0
    complaint: str = ""
    last: str = ""


class Watcher:
    """Feed it the redacted output; `tick` states when the run has to be ended, `reason` why."""

    def __init__(
        self,
        dialect: Dialect | None,
        limits: TaskLimits,
        sink: ProgressSink,
        price: Price | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._dialect = dialect
        self._limits = limits
        self._sink = sink
        self._price = price
        self._clock = clock
        self._began = clock()
        self._seen = _Seen(active=self._began)
        self._lines = {"stdout": _Lines(), "stderr": _Lines()}
        self._plain = Progress(self._on_output, clock)
        self._transcript: _Transcript | None = None
        self._secrets: Mapping[str, str] = {}
        self.reason: ExitReason | None = None

    def recording(self, path: Path, secrets: Mapping[str, str] | None = None) -> "Watcher":
        """Also write the transcript to that file; OSError when it cannot be made.

        ``secrets``, by name, are redacted once more in what a dialect has read: a line may spell one out letter by
        letter, and a word that came in pieces is whole only there.
        """
        self._transcript = _Transcript(path)
        self._secrets = secrets or {}
        return self

    @property
    def turns(self) -> int | None:
        """Replies of the model so far; None when this output does not report them."""
        return self._seen.turns if self._dialect is not None else None

    @property
    def usage(self) -> Usage:
        """The usage so far, with its cost: by the owner's price, the program's own report, or a table's price."""
        used = self._seen.totals or self._seen.usage
        owners = self._price is not None and self._price.source == OWNERS
        if self._price is not None and (owners or used.cost_usd is None):
            return replace(used, cost_usd=cost_of(used, self._price), cost_source=self._price.source)
        return used

    @property
    def problem(self) -> ModelProblem | None:
        """The last problem of the model's side, unless the run went on after it."""
        return self._seen.problem

    @property
    def closed(self) -> Closed | None:
        """The program's own word that its run is over."""
        return self._seen.closed

    @property
    def last_words(self) -> str:
        """The end of standard error, and its last line about an error; empty where there is none.

        Only where a dialect reads the output: what others print is shown as it is.
        """
        return "; ".join(dict.fromkeys(text for text in (self._seen.complaint, self._seen.last) if text))

    def feed(self, stream: str, data: bytes) -> None:
        """Take a piece of output."""
        if self._dialect is None:
            if data:
                self._seen.active = self._clock()
            if stream == "stdout":
                self._plain.feed(data)
            return
        for line in self._lines[stream].feed(data):
            self._read(stream, line)

    def tick(self) -> bool:
        """Show what waits to be shown; True when the run has to be ended now."""
        self._plain.tick()
        self.reason = self.reason or self._verdict()
        return self.reason is not None

    def finish(self) -> None:
        """The output has ended."""
        if self._dialect is not None:
            for stream, lines in self._lines.items():
                for line in lines.rest():
                    self._read(stream, line)
        self._plain.finish()
        if self._transcript is not None:
            self._transcript.close()

    def _read(self, stream: str, line: bytes) -> None:
        assert self._dialect is not None
        if stream == "stderr" and line.strip():
            text = one_line(line.decode("utf-8", "replace"))
            self._seen.last = text
            self._seen.complaint = text if "error" in text.lower() else self._seen.complaint
        for event in self._dialect.read(stream, line):
            self._take(self._clean(event))

    def _clean(self, event: AgentEvent) -> AgentEvent:
        if isinstance(event, Output | ToolCalled | ModelProblem | Closed):
            return replace(event, text=redacted(event.text, self._secrets))
        return event

    def _verdict(self) -> ExitReason | None:
        now, seen, limits = self._clock(), self._seen, self._limits
        if seen.closed is not None and seen.closed.ok and seen.problem is None:
            # Done by its own word: what keeps it from leaving is no part of its work.
            return ExitReason.FINISHED if now - seen.closed_at > CLOSING_SECONDS else None
        if seen.problem is not None and (seen.problem.final or now - seen.trouble_since > limits.patience_seconds):
            return seen.problem.reason
        if limits.turns is not None and seen.turns > limits.turns:
            return ExitReason.TURN_LIMIT
        cost = self.usage.cost_usd
        if limits.usd is not None and cost is not None and cost > limits.usd:
            return ExitReason.BUDGET
        if limits.idle_seconds is not None and now - seen.active > limits.idle_seconds:
            return seen.problem.reason if seen.problem is not None else ExitReason.IDLE
        return None

    def _take(self, event: AgentEvent) -> None:
        self._note(event)
        if isinstance(event, Replying):
            return
        if self._transcript is not None:
            self._transcript.write(event, self._clock() - self._began)
        if isinstance(event, Output):
            self._plain.feed(event.text.encode() + b"\n")
        else:
            self._emit(event)

    def _note(self, event: AgentEvent) -> None:
        seen = self._seen
        match event:
            case ModelProblem():
                seen.trouble_since = self._clock() if seen.problem is None else seen.trouble_since
                seen.problem = event
                return
            case Turn():
                seen.turns += 1
                seen.usage = added(seen.usage, event.usage)
                seen.problem = None
            case ToolCalled() | ToolReturned():
                seen.problem = None
            case Replying():
                # It may yet be cut off, so the problem stays; but a long reply is no trying again.
                seen.trouble_since = self._clock()
            case Totals():
                seen.totals = event.usage
            case Closed():
                seen.closed, seen.closed_at = event, self._clock()
        seen.active = self._clock()

    def _on_output(self, text: str, _: float) -> None:
        event = Output(text)
        if text and self._dialect is None and self._transcript is not None:
            self._transcript.write(event, self._clock() - self._began)
        self._emit(event)

    def _emit(self, event: AgentEvent) -> None:
        self._sink(event, self._clock() - self._began, self.usage)


def added(before: Usage, after: Usage) -> Usage:
    """The sum of two usages; what is unknown in one of them counts as nothing, in both as unknown."""

    def total(one: float | None, two: float | None) -> float | None:
        return two if one is None else one if two is None else one + two

    def tokens(one: int | None, two: int | None) -> int | None:
        return two if one is None else one if two is None else one + two

    return Usage(
        tokens(before.input_tokens, after.input_tokens),
        tokens(before.cached_tokens, after.cached_tokens),
        tokens(before.output_tokens, after.output_tokens),
        total(before.cost_usd, after.cost_usd),
        after.cost_source or before.cost_source,
    )


class _Lines:
    """Cuts a stream into lines; one that is longer than any event is dropped to its end."""

    def __init__(self) -> None:
        self._held: list[bytes] = []
        self._size = 0

    def feed(self, data: bytes) -> list[bytes]:
        *whole, rest = data.split(b"\n")
        out = []
        for piece in whole:
            if self._size <= MAX_LINE:
                out.append(b"".join((*self._held, piece)))
            self._held, self._size = [], 0
        self._size += len(rest)
        if self._size > MAX_LINE:
            self._held = []
        elif rest:
            self._held.append(rest)
        return out

    def rest(self) -> list[bytes]:
        """The bytes after the last line end."""
        return [b"".join(self._held)] if self._held else []


class _Transcript:
    """A file of events, bounded; its descriptor is held, so that the agent cannot put another file in its place."""

    def __init__(self, path: Path) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        self._descriptor = os.open(path, flags, 0o600)
        self._left = TRANSCRIPT_BYTES

    def write(self, event: AgentEvent, elapsed: float) -> None:
        fields = {name: value for name, value in asdict(event).items() if value is not None}
        line = json.dumps({"at": round(elapsed, 3), "event": KINDS[type(event)], **fields}, ensure_ascii=False)
        data = line.encode("utf-8", "replace") + b"\n"
        self._left -= len(data)
        if self._left >= 0:
            # octoform's next write reports a full disk; the run itself must still be seen to its end.
            with suppress(OSError):
                os.write(self._descriptor, data)

    def close(self) -> None:
        os.close(self._descriptor)
