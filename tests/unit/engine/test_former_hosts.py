"""The endpoint of a host that the manifest no longer names: it is reported, and can be stopped."""

import errno
import json
import os
import shutil
from pathlib import Path

import pytest
from endings import record_running
from settled import Settled

from octoform.cli.main import main
from octoform.endpoint.process import record
from octoform.endpoint.process.record import is_marked, running, running_beside
from octoform.state.files import refused
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


SPOILT = {
    "a typo": lambda project: (project / "octopus.yaml").write_text("version: 1\nhost: bench\nharnes: builtin\n"),
    "no YAML": lambda project: (project / "octopus.yaml").write_text("{"),
    "a spec without front matter": lambda project: (project / "protocol" / "probe.md").write_text("none\n"),
}


@pytest.fixture
def alone(renamed: Path) -> Path:
    """The same project, and the running endpoint is the one that it has."""
    shutil.rmtree(renamed / ".octoform" / "former")
    record_running(Layout(renamed, "bench").run)
    return renamed


@pytest.mark.parametrize("spoilt", SPOILT)
def test_no_error_in_a_source_keeps_a_person_from_stopping(
    alone: Path, capsys: pytest.CaptureFixture[str], spoilt: str
) -> None:
    shutil.copytree(Path(__file__).parents[3] / "protocol", alone / "protocol")
    SPOILT[spoilt](alone)
    layout = Layout(alone, "bench")
    assert running(layout) is not None
    assert main(["-chdir", str(alone), "stop"]) == 0
    shown = capsys.readouterr()
    assert shown.out.startswith("bench: the endpoint was stopped") and "warning[" in shown.err
    assert running(layout) is None and is_marked(layout)


def test_of_several_endpoints_a_person_names_one(renamed: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (renamed / "octopus.yaml").write_text("{")
    Layout(renamed, "bench").run.mkdir(parents=True, exist_ok=True)
    assert main(["-chdir", str(renamed), "stop"]) == 1
    assert "octoform stop bench or octoform stop former" in capsys.readouterr().err
    assert running(Layout(renamed, "former")) is not None


def test_a_stop_that_cannot_be_written_down_is_none_that_stays(
    alone: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = Layout(alone, "bench")
    monkeypatch.setattr(
        record, "write_atomic", lambda path, *_: refused(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), path)
    )
    assert main(["-chdir", str(alone), "stop", "-json"]) == 1
    shown = capsys.readouterr()
    assert json.loads(shown.out)["stays"] is False and "STATE-DISK-FULL" in shown.err
    record_running(layout.run)
    assert main(["-chdir", str(alone), "stop"]) == 1
    shown = capsys.readouterr()
    assert "may start it again" in shown.out and "stays stopped" not in shown.out
