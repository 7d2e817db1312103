"""The fixture that runs a program contained, in the test's own folder."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from octoform.harness.containment.contained_run import Ended, Limits, Program, run
from octoform.harness.port import AgentEvent, Output, TaskLimits, Usage
from octoform.harness.watcher import Watcher


@pytest.fixture
def contained(tmp_path: Path) -> Callable[..., Ended]:
    """Runs a program in ``tmp_path`` with its log in ``task.log``; keywords are those of Limits and ``stdin``."""

    def start(argv: tuple[str, ...], **settings: Any) -> Ended:
        found = settings.pop("progress", lambda text, seconds: None)

        def progress(event: AgentEvent, seconds: float, _: Usage) -> None:
            assert isinstance(event, Output)
            found(event.text, seconds)

        watcher = Watcher(None, TaskLimits(30.0), progress)
        stdin = settings.pop("stdin", None)
        limits = Limits(**{"wall_seconds": 30.0, "grace_seconds": 0.2, **settings})
        program = Program(argv, tmp_path, {"PATH": "/usr/bin:/bin"}, tmp_path / "task.log", stdin=stdin)
        return run(program, limits, watcher)

    return start
