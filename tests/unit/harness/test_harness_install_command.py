"""``octoform install`` as it is typed: what it prints, where, and with which status it leaves."""

import json
import shlex
import sys
from pathlib import Path

import pytest
from unit.harness.fake_npm import Machine

from octoform.cli.main import main
from octoform.engine.doctor import elsewhere

PI = """put(binary="pi", program="print('0.87.1')")"""


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Machine:
    made = Machine(tmp_path)
    made.node()
    made.npm(PI)
    for name, value in made.environ().items():
        monkeypatch.setenv(name, value)
    return made


def test_steps_go_to_the_person_and_what_is_there_to_the_output(
    machine: Machine, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["install", "pi", "builtin"]) == 0
    found = capsys.readouterr()
    home = machine.agents / "pi-0.87.1"
    assert found.out.splitlines() == [
        f"pi 0.87.1: installed, {home}",
        "builtin: nothing to install, it comes with octoform",
    ]
    assert found.err == "pi: installing @earendil-works/pi-coding-agent 0.87.1 with npm on node 22.20.0\n"
    assert main(["install", "pi"]) == 0
    assert capsys.readouterr().out == f"pi 0.87.1: installed already, {home}\n"


def test_one_that_fails_does_not_keep_the_others_back(machine: Machine, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install", "-json", "piii", "pi", "pi"]) == 1
    document = json.loads(capsys.readouterr().out)
    assert [(item["harness"], item["state"], item["version"]) for item in document["installed"]] == [
        ("pi", "installed", "0.87.1")
    ]
    assert [item["code"] for item in document["diagnostics"]] == ["HARNESS-UNKNOWN"]
    machine.npm("sys.exit('no such package')")
    (machine.agents / "pi-0.87.1" / "installed.json").unlink()
    assert main(["install", "pi"]) == 1
    assert "no such package" in capsys.readouterr().err


def test_litellm_is_beside_octoform(machine: Machine, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["install", "litellm"]) == 0
    assert f"installed already, {sys.prefix}" in capsys.readouterr().out


def test_an_environment_of_another_tool_is_left_to_it(tmp_path: Path) -> None:
    assert elsewhere(Path(sys.prefix), "litellm==1") is None
    (tmp_path / "pipx_metadata.json").touch()
    assert elsewhere(tmp_path, "litellm>=1,<2") == f"pipx inject octoform {shlex.quote('litellm>=1,<2')}"
    (tmp_path / "uv-receipt.toml").touch()
    assert elsewhere(tmp_path, "litellm==1") == "uv tool install --with litellm==1 octoform"
