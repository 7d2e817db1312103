"""Plan and the end of apply say which agents no sandbox holds."""

import json
import os
import sys
from pathlib import Path

import older_kernel
import pytest
from projects import Project


def warned(project: Project, *arguments: str) -> list[str]:
    done = project.run(*arguments, "--json")
    found = []
    for event in done.events():
        item = event.get("diagnostic", {})
        found += [item["summary"]] if item.get("code") == "HARNESS-UNCONFINED" else []
    return found


@pytest.fixture
def project(tmp_path: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.write()
    return made


def test_plan_and_apply_name_the_stages_of_an_agent_without_sandbox(project: Project) -> None:
    assert "probe" in warned(project, "plan")[0]
    assert "`sandbox: false`" in warned(project, "plan")[0]
    project.script = {"probe": ["good"]}
    done = project.apply("-target", "probe", status=0)
    assert "HARNESS-UNCONFINED" in done.codes()
    assert "runs without a sandbox" in project.run("plan").text
    record = json.loads((project.attempts("probe")[0] / "attempt.json").read_text())
    assert record["unconfined"] == ""  # none was requested


def test_where_it_cannot_be_had_the_reason_is_given(project: Project, tmp_path: Path) -> None:
    folder = tmp_path / "broken"
    folder.mkdir()
    (folder / "bwrap").write_text("#!/bin/sh\necho 'bwrap: No permissions to create a new namespace' >&2\nexit 1\n")
    (folder / "bwrap").chmod(0o755)
    project.environ = {"PATH": f"{folder}:{os.environ['PATH']}"}
    project.harness = "{name: command, command: [agent]}"
    project.write()
    assert "No permissions to create a new namespace" in warned(project, "plan")[0]
    project.harness = "{name: command, command: [agent], sandbox: true}"
    project.write()
    assert warned(project, "plan") == []


def test_a_confined_agent_and_the_embedded_one_are_not_spoken_of(project: Project) -> None:
    for harness in ("{name: command, command: [agent]}", "builtin"):
        project.harness = harness
        project.write()
        assert warned(project, "plan") == []


@pytest.mark.parametrize(
    ("without", "means"), [("landlock", "abstract Unix sockets"), ("seccomp", "every call of the kernel")]
)
def test_a_wall_that_the_kernel_does_not_have_is_named(project: Project, without: str, means: str) -> None:
    project.harness = '{name: command, command: [/bin/sh, -c, "exit 1"]}'
    project.manifest["budget"] = "{attempts: 1}"
    project.write()
    project.prefix = [sys.executable, older_kernel.__file__, without]
    for command in (("plan",), ("apply", "-auto-approve", "-target", "probe")):
        lines = [line for line in project.run(*command).err.splitlines() if "[HARNESS-WALL-MISSING]" in line]
        assert any(means in line for line in lines), lines
    doctor = project.run("doctor").text
    assert "lacks a wall" in " ".join(doctor.split()) and means in " ".join(doctor.split())
