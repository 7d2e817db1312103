"""The host's own scan where it fails: reported, and no reason to refuse what another agent wrote."""

from types import SimpleNamespace
from typing import Any

import pytest

from octoform.apply.stage import assignment
from octoform.harness.port import ExitReason, Outcome, Task

CONTEXT: Any = SimpleNamespace(environ={}, manifest=SimpleNamespace(variables=()))


class Failing:
    """An embedded agent that ends otherwise than it should; ``left`` is what it writes before."""

    name = "builtin"

    def __init__(self, reason: ExitReason, detail: str, said: str = "") -> None:
        self._outcome, self._said = Outcome(reason, 1, 0.1, detail), said

    def run(self, task: Task, _progress: object) -> Outcome:
        task.log.write_text(self._said)
        return self._outcome


@pytest.mark.parametrize(
    ("agent", "told"),
    [
        (Failing(ExitReason.CRASHED, "", "scanning\nthis stage needs more memory\n"), "this stage needs more memory"),
        (Failing(ExitReason.TIMEOUT, "no end within 120 s"), "no end within 120 s"),
        (Failing(ExitReason.FINISHED, ""), "finished"),
    ],
)
def test_a_scan_that_comes_to_nothing_is_a_warning(agent: Failing, told: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(assignment, "resolve_harness", lambda *_: agent)
    found, (warning,) = assignment.scan_beside(CONTEXT, {"devices": []})
    assert found is None
    assert (warning.code, warning.severity.value) == ("PROBE-NOT-HELD", "warning")
    assert told in warning.summary
