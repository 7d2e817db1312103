"""The fixture that runs a program contained, in the test's own folder."""

from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.harness.containment.contained_run import Ended, Limits, Program, run
from octoform.harness.port import TaskLimits
from octoform.harness.watcher import Watcher


@pytest.fixture
def contained(tmp_path: Path) -> Callable[..., Ended]:
    """Runs a program in ``tmp_path`` with its log in ``task.log``; keywords are those of Limits and ``stdin``."""

    def start(argv: tuple[str, ...], **settings: object) -> Ended:
        said = settings.pop("progress", lambda text, seconds: None)
        watcher = Watcher(None, TaskLimits(30.0), lambda event, seconds, _: said(event.text, seconds))  # type: ignore[operator]
        stdin = settings.pop("stdin", None)
        limits = Limits(**{"wall_seconds": 30.0, "grace_seconds": 0.2, **settings})  # type: ignore[arg-type]
        program = Program(argv, tmp_path, {"PATH": "/usr/bin:/bin"}, tmp_path / "task.log", stdin=stdin)  # type: ignore[arg-type]
        return run(program, limits, watcher)

    return start
