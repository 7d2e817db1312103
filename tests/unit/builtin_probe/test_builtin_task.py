"""The embedded agent's task: read, refused with one line, output written whole."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from octoform.builtin.__main__ import main
from octoform.builtin.task import DEFAULT_TOOLS, Task, TaskRefused, read_task


def write(folder: Path, **changes: object) -> Path:
    document = {"format": 1, "stage": "probe", "input": None, "schema": None, "output": str(folder / "output.json")}
    (folder / "task.json").write_text(json.dumps({**document, **changes}))
    return folder / "task.json"


def test_a_task_is_read(tmp_path: Path) -> None:
    path = write(tmp_path, stage="identify", input="/x/probe.json", limits={"tools": 7})
    task = read_task(path, {"OCTOFORM_SYSROOT": "/recorded"})
    assert task == Task("identify", Path("/x/probe.json"), None, tmp_path / "output.json", 7, Path("/recorded"))


@pytest.mark.parametrize("limits", [None, {}, {"tools": 0}, {"tools": True}, {"tools": "9"}])
def test_without_a_usable_budget_the_default_holds(limits: object, tmp_path: Path) -> None:
    task = read_task(write(tmp_path, limits=limits), {})
    assert (task.tools_budget, task.sysroot) == (DEFAULT_TOOLS, Path("/"))


def test_profiles_and_answers_are_read(tmp_path: Path) -> None:
    task = read_task(write(tmp_path, profiles=[{"name": "lamp"}], answers={"usb-1": "the lamp"}), {})
    assert (task.profiles, task.answers) == (({"name": "lamp"},), {"usb-1": "the lamp"})


def test_the_devices_that_were_refused_before_are_read(tmp_path: Path) -> None:
    devices = [{"id": name, "category": "sensor"} for name in ("one", "two", "three")]
    (tmp_path / "former-output.json").write_text(json.dumps({"devices": devices}))
    lines = [
        {"severity": "error", "pointer": "/devices/1/identified_as"},
        {"severity": "warning", "pointer": "/devices/0"},
        {"severity": "error", "pointer": "/left_out/2"},
        {"severity": "error", "pointer": "/devices/9"},
    ]
    assert read_task(write(tmp_path, diagnostics=lines), {}).refused == (devices[1],)
    (tmp_path / "former-output.json").unlink()
    assert read_task(write(tmp_path, diagnostics=lines), {}).refused == ()


@pytest.mark.parametrize(
    "changes",
    [
        *({"stage": "dance"}, {"output": None}, {"output": 3}, {"input": ""}),
        *({"profiles": {}}, {"profiles": ["lamp"]}, {"answers": ["the lamp"]}, {"answers": {"usb-1": 1}}),
    ],
)
def test_a_wrong_task_is_refused(changes: dict[str, object], tmp_path: Path) -> None:
    with pytest.raises(TaskRefused):
        read_task(write(tmp_path, **changes), {})


@pytest.mark.parametrize("text", ["", "[]", "{", "\xff"])
def test_a_task_that_is_no_object_fails_with_one_line(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "task.json").write_text(text, encoding="latin-1")
    assert main([str(tmp_path / "task.json")]) == 1
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_the_preceding_artifact_must_be_there(tmp_path: Path) -> None:
    task = read_task(write(tmp_path, stage="identify"), {})
    with pytest.raises(TaskRefused, match="preceding"):
        task.read_input()
    task = read_task(write(tmp_path, stage="identify", input=str(tmp_path / "none.json")), {})
    with pytest.raises(TaskRefused, match="cannot read"):
        task.read_input()


def test_output_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    task = read_task(write(tmp_path), {})
    task.write({"a": 1})
    assert json.loads(task.output.read_text()) == {"a": 1}
    task.write("text\n")
    assert task.output.read_text() == "text\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["output.json", "task.json"]


def test_a_folder_that_is_gone_is_a_clear_failure(tmp_path: Path) -> None:
    task = read_task(write(tmp_path, output=str(tmp_path / "gone/output.json")), {})
    with pytest.raises(TaskRefused, match="cannot write"):
        task.write({})


def test_the_program_says_what_failed_in_one_line(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "octoform.builtin", str(tmp_path / "none.json")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, len(done.stderr.splitlines())) == (1, "", 1)
