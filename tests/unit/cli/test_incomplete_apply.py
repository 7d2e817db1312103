"""How an apply ends that is incomplete: with the code that `status` has then."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from octoform.cli.commands.run import status_of
from octoform.daemon import status
from octoform.daemon.model import Status
from octoform.engine.plan.plan import Request


@pytest.mark.parametrize(
    ("word", "code"),
    [(Status.UNKNOWN, 6), (Status.DEGRADED, 3), (Status.ERROR, 4), (Status.DOWN, 5), (Status.HEALTHY, 3), (None, 3)],
)
def test_its_code_is_that_of_status(monkeypatch: pytest.MonkeyPatch, word: Status | None, code: int) -> None:
    seen = SimpleNamespace(health=SimpleNamespace(status=word)) if word is not None else None
    monkeypatch.setattr(status, "survey", lambda *_: (seen, []))
    result: Any = SimpleNamespace(failed=None, incomplete=(), silent="no read tool answered")
    assert status_of(result, Request(Path("/nowhere"), {})) == code


@pytest.mark.parametrize(("failed", "code"), [(None, 0), ("serve", 1)])
def test_nobody_looks_at_what_is_complete_or_failed(
    monkeypatch: pytest.MonkeyPatch, failed: str | None, code: int
) -> None:
    monkeypatch.setattr(status, "survey", lambda *_: pytest.fail("looked"))
    result: Any = SimpleNamespace(failed=failed, incomplete=(), silent="")
    assert status_of(result, Request(Path("/nowhere"), {})) == code
