"""Harness ``replay``: a recorded run is the agent.

It starts no program, asks no model and waits for nothing: the recorded transcript is reported as it was, the recorded
edit of the spec is made, the recorded output is written, and the gate judges it like any other. So what a real agent
once did on a host can be gone through again, failures included, on every machine and for nothing.
"""

import os
import time
from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.harness import transcript
from octoform.harness.port import ExitReason, Outcome, ProgressSink, Task, Totals, Turn, Usage
from octoform.harness.port import Output as AgentOutput
from octoform.harness.recording import Attempt, Output, Recording, content, load
from octoform.harness.watcher import added
from octoform.manifest.model import HarnessSpec
from octoform.records import dataclass

UNREPEATABLE = frozenset(
    {"APPLY-OUTSIDE-WRITE", "APPLY-SECRET-IN-OUTPUT", "PROBE-DEVICE-UNKNOWN", "PROBE-CONTRADICTED"}
    | {"PROBE-DEVICE-MISSING", "PROBE-TEXT-NOT-OF-HOST"}
)
"""What an attempt was refused for besides its output: what it did, and the host that it was on.

A replay does not do it again and may be on another host, but it was no success either.
"""


@dataclass(frozen=True, slots=True)
class ReplayHarness:
    """Plays the attempts of one recording; what it cannot play is an agent that could not be started."""

    folder: Path
    recording: Recording
    name: str = "replay"

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        began = time.monotonic()
        if (task.workdir / "input.json").is_file():
            return _unplayable("a recording holds the whole answer of a stage; leave escalate out to replay it")
        played = self.recording.attempt(task.stage, task.attempt)
        if played is None:
            return _unplayable(f"the recording has no attempt of {task.stage}")
        files = {name: content(self.folder, name) for name in played.files()}
        gone = [name for name, data in files.items() if data is None]
        if gone:
            return _unplayable(f"{gone[0]} of the recording is missing, or is no plain file")
        there = {name: data for name, data in files.items() if data is not None}
        _replay_events(task, there.get(played.transcript or "", b""), progress)
        if played.spec_edit is not None:
            _put(task.workdir / "spec.md", there[played.spec_edit], 0o644)
        if played.output is not None:
            _leave(task.output, played.output, there.get(played.output.file or "", b""))
        return _ended(played, time.monotonic() - began)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> ReplayHarness | Diagnostic:
    """The harness, or what is wrong with its settings or with the recording."""
    if spec.recording is None:
        return error(
            "HARNESS-NO-RECORDING",
            "the replay harness has no recording",
            hint="name its folder: harness: {name: replay, recording: recordings/bench}",
        )
    found = load(spec.recording)
    return found if isinstance(found, Diagnostic) else ReplayHarness(spec.recording, found)


def _replay_events(task: Task, data: bytes, progress: ProgressSink) -> None:
    """Every event at once, with the time and the sum that it had then; the same lines become this attempt's own."""
    _put(task.transcript, data, 0o600)
    used, totals, found = Usage(), None, []
    for moment in transcript.decode(data):
        event = moment.event
        if isinstance(event, Turn):
            used = added(used, event.usage)
        elif isinstance(event, Totals):
            totals = event.usage
        elif isinstance(event, AgentOutput):
            found.append(event.text)
        progress(event, moment.at, totals or used)
    _put(task.log, "".join(f"{line}\n" for line in found).encode("utf-8", "replace"), 0o600)


def _leave(path: Path, output: Output, data: bytes) -> None:
    """Write the recorded output, or the file that was none."""
    if output.kind == "link":
        path.symlink_to(os.devnull)
        return
    _put(path, data, 0o644)
    if output.kind == "large":
        os.truncate(path, output.size or 0)


def _put(path: Path, data: bytes, mode: int) -> None:
    """A file of its own in place of what is there, so that nothing is written through a link."""
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, mode)
    with os.fdopen(descriptor, "wb") as stream:
        stream.write(data)


def _ended(played: Attempt, seconds: float) -> Outcome:
    usage = Usage(
        played.usage.input_tokens,
        played.usage.cached_tokens,
        played.usage.output_tokens,
        played.usage.cost_usd,
        played.usage.cost_source,
    )
    reason, status, detail = played.reason, played.exit_status, played.detail
    if reason is ExitReason.FINISHED and played.refused and UNREPEATABLE.issuperset(played.refused):
        reason, status = ExitReason.CRASHED, None
        codes = ", ".join(sorted(set(played.refused)))
        detail = f"the recorded attempt was rejected with {codes}, which a replay does not do again"
    return Outcome(reason, status, seconds, detail, usage, turns=played.turns, program=played.program)


def _unplayable(what: str) -> Outcome:
    return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, what)
