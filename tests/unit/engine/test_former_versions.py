"""A project and a saved plan of each released version are read by this one, and nothing has to be done again."""

import json
from pathlib import Path

import former
import pytest

from octoform.cli.main import main

VERSIONS = sorted(path.name for path in former.KEPT.iterdir())


@pytest.fixture
def project(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    found, root = former.restored(version, tmp_path)
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(root))
    return found


@pytest.mark.parametrize("version", VERSIONS)
def test_its_project_needs_no_changes(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-chdir", str(project), "plan", "-detailed-exitcode"]) == 0
    printed = capsys.readouterr()
    assert "No changes." in printed.out
    assert printed.err == ""


@pytest.mark.parametrize("version", VERSIONS)
def test_its_saved_plan_is_shown(project: Path, version: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-chdir", str(project), "show", "-json", str(project / "saved.plan")]) == 0
    lines = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    (summary,) = [line for line in lines if line["type"] == "change_summary"]
    assert summary["changes"] == {"add": 0, "change": 0, "remove": 0, "maybe": 0, "operation": "apply"}


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_of_a_later_format_is_refused_whole(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = project / "state/bench/state.json"
    path.write_text(path.read_text().replace('"format": 1', '"format": 99', 1))
    assert main(["-chdir", str(project), "plan"]) == 1
    assert "99" in capsys.readouterr().err
