"""Attempt folders as an apply leaves them, made by hand: for tests of what reads them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from octoform.harness.port import AgentEvent
from octoform.harness.transcript import Moment, encode
from octoform.state import attempts
from octoform.state.attempts import AttemptRecord
from octoform.state.layout import OUTPUT_NAMES, Layout

MANIFEST = "version: 1\nhost: bench\nharness: builtin\n"


class Folders:
    """A project folder whose attempts are made one by one."""

    def __init__(self, project: Path) -> None:
        self.project = project
        self.layout = Layout(project, "bench")
        self.layout.attempts.mkdir(parents=True)
        (project / "octopus.yaml").write_text(MANIFEST)
        self._count = 0

    def add(
        self,
        stage: str,
        attempt: int,
        *,
        output: bytes | None = None,
        spec: str = "# spec\n",
        events: Sequence[AgentEvent] = (),
        record: bool = True,
        **fields: Any,
    ) -> Path:
        """The next attempt; ``record=False`` leaves the folder as it is while the agent runs."""
        self._count += 1
        folder = self.layout.attempts / f"{self._count:06d}-{stage}-{attempt}"
        folder.mkdir()
        (folder / "spec.md").write_text(spec)
        (folder / "prompt.md").write_text("the prompt\n")
        (folder / "agent.log").write_text("the log\n")
        (folder / "task.json").write_text(json.dumps({"format": 1, "stage": stage}))
        (folder / "transcript.jsonl").write_bytes(encode(Moment(float(at), event) for at, event in enumerate(events)))
        if output is not None:
            (folder / OUTPUT_NAMES.get(stage, "output.json")).write_bytes(output)
        if record:
            given = {"harness": "pi", "started_at": "2026-01-02T03:04:05Z", "seconds": 1.5, "reason": "finished"}
            whole = {**given, "number": self._count, "stage": stage, "attempt": attempt, "prompt_bytes": 11, **fields}
            assert attempts.write(folder, AttemptRecord(**whole)) is None
        return folder

    def accept(self, stage: str, data: bytes) -> None:
        """Put the accepted artifact of a stage where git has it."""
        path = self.layout.output(stage)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(data)
