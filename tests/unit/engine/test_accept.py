"""What can be adopted by hand: an artifact whose predecessors are in the state, and nothing else."""

import os
from pathlib import Path

import pytest
from settled import Settled, sysroot

from octoform.engine.inspect.state import accept, forget


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "project"
    folder.mkdir()
    (folder / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(sysroot(tmp_path / "root", ["usb:v0A0Ap0001d0100"])))
    Settled(folder, os.environ).apply()
    return folder


def test_what_rests_on_a_forgotten_node_is_not_adopted(project: Path) -> None:
    assert forget(project, os.environ, "identify") == []
    (problem,) = accept(project, os.environ, "interface")
    assert problem.code == "STATE-NO-NODE"
    assert problem.summary == "interface rests on identify, which the state does not have"


def test_the_endpoint_is_no_artifact(project: Path) -> None:
    (problem,) = accept(project, os.environ, "endpoint")
    assert problem.code == "ARTIFACT-MISSING"
    assert "nothing to accept" in problem.summary


def test_an_artifact_as_it_was_left_is_adopted(project: Path) -> None:
    assert [item.code for item in accept(project, os.environ, "interface")] == []
