"""Combinations of options that apply must not quietly ignore."""

import pytest

from octoform.cli.main import main


@pytest.mark.parametrize("option", ["-target", "-replace"])
def test_a_saved_plan_keeps_its_own_targets(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["apply", "saved", option, "probe"]) == 1
    assert "a saved plan has its own -target and -replace" in capsys.readouterr().err
