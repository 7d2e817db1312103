"""The endpoint of a host that the manifest no longer names: it is reported, and can be stopped."""

import json
from pathlib import Path

import pytest
from endings import record_running
from settled import Settled

from octoform.cli.main import main
from octoform.endpoint.process.record import running, running_beside
from octoform.state.layout import Layout

MANIFEST = "version: 1\nhost: {}\nharness: {{name: command, command: [my-agent]}}\n"


@pytest.fixture
def renamed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A settled project whose folder also holds the running endpoint of a former name."""
    root = tmp_path / "root"
    root.mkdir()
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(root))
    project = tmp_path / "project"
    project.mkdir()
    (project / "octopus.yaml").write_text(MANIFEST.format("bench"))
    Settled(project, {"OCTOFORM_SYSROOT": str(root)}).apply()
    record_running(Layout(project, "former").run)
    return project


def test_only_others_that_run_are_beside(renamed: Path) -> None:
    layout = Layout(renamed, "bench")
    assert running_beside(layout) == ("former",)
    record = Layout(renamed, "former").run / "process.json"
    record.write_text(json.dumps({**json.loads(record.read_text()), "start": 1}))
    assert running_beside(layout) == ()


def test_plan_and_status_tell_of_it(renamed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["-chdir", str(renamed), "plan"])
    assert "warning[PLAN-OTHER-ENDPOINT]: the endpoint of host former runs" in capsys.readouterr().err
    main(["-chdir", str(renamed), "status", "-json"])
    assert json.loads(capsys.readouterr().out)["others"] == ["former"]


def test_it_is_stopped_by_its_name(renamed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["-chdir", str(renamed), "stop", "formr"]) == 1
    assert "did you mean former?" in capsys.readouterr().err
    assert main(["-chdir", str(renamed), "stop", "former"]) == 0
    assert capsys.readouterr().out.startswith("former: the endpoint was stopped")
    assert running(Layout(renamed, "former")) is None
