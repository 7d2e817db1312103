"""The duties of the daemon's agents can be listed as every stage can."""

from pathlib import Path

import pytest

from octoform.cli.main import main
from octoform.views.attempts import COLUMNS
from octoform.views.format.table import lines


@pytest.mark.parametrize("stage", ["serve", "watch", "heal", "step.arm"])
def test_what_an_agent_is_started_for_can_be_asked_for(tmp_path: Path, stage: str) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    assert main(["-chdir", str(tmp_path), "attempts", "-stage", stage]) == 0


def test_what_no_agent_is_started_for_is_told_with_what_was_meant(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["attempts", "-stage", "heel"]) == 1
    assert "-stage: there is no stage 'heel'; did you mean heal?" in capsys.readouterr().err


@pytest.mark.parametrize("width", [80, 100])
def test_what_an_attempt_cost_is_shown_on_a_usual_terminal(width: int) -> None:
    agent = "claude-code, anthropic/claude-sonnet-4-5"
    row = ("2", "identify", "1", agent, "accepted", "2.1s", "9", "1.0k/100", "$0.25", "2026-11-26 11:48:59Z")
    assert all(len(line) <= width for line in lines(COLUMNS, [row], width))
    assert "$0.25" in list(lines(COLUMNS, [row], width))[1]
