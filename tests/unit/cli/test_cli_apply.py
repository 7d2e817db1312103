"""Combinations of options that apply must not quietly ignore."""

import pytest

from octoform.cli.main import main


@pytest.mark.parametrize("options", [("-target", "probe"), ("-replace", "probe"), ("-no-reuse",), ("-tier1",)])
def test_a_saved_plan_keeps_its_own_targets(options: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["apply", "saved", *options]) == 1
    assert "a saved plan has its own -target, -replace, -no-reuse and -tier1" in capsys.readouterr().err
