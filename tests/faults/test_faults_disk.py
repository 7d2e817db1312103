"""Disks that are full or closed: named, before the agent's budget is spent on them, and nothing is lost."""

import json
import shutil
from pathlib import Path

import disks
from projects import Project


def test_f09a_an_agent_that_fills_the_disk_is_no_bad_agent(project: Project) -> None:
    project.prefix = disks.small_disk(project.local, 1024)
    project.script = {"probe": [{"ballast": "ballast.bin"}]}
    project.write()
    done = project.run("apply", "-auto-approve", "-target", "identify", status=1)
    assert "STATE-DISK-FULL" in done.err
    assert "Traceback" not in done.text
    assert len(project.agent_runs()) <= 1
    project.prefix, project.script = [], {}
    project.apply("-target", "identify", status=0)
    assert {node["status"] for node in project.nodes().values()} == {"accepted"}


def test_f09a_what_was_accepted_before_the_disk_was_full_is_kept(project: Project) -> None:
    project.prefix = disks.small_disk(project.local, 1024)
    project.script = {"probe": [{"fill": "ballast.bin"}]}
    project.write()
    done = project.run("apply", "-auto-approve", "-target", "identify", status=1)
    assert "STATE-DISK-FULL" in done.err
    assert len(project.agent_runs()) <= 1
    kept = project.agent_runs() and (project.state / "state.json").exists()
    if disks.mounts_are_permitted():
        assert kept
        assert project.nodes()["probe"]["status"] == "accepted"
        assert str(project.local) in done.err  # the disk is named
    before = len(project.agent_runs())
    artifact = project.state / "probe" / "output.json"
    accepted = artifact.read_bytes() if artifact.exists() else None
    project.prefix, project.script = [], {}
    project.apply("-target", "identify", status=0)
    # The instances lay on the disk that is gone, so PROBE finds them again; what it had found stays as it was.
    assert project.stages_run()[before:] == ["probe", "identify"]
    assert accepted is None or json.loads(accepted)["devices"][0]["id"] == "hwmon-benchtemp"


def test_f09b_a_state_folder_that_cannot_be_written_is_one_error_before_any_agent(project: Project) -> None:
    project.prefix = disks.closed_folder(project.folder / "state")
    done = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert done.err.count("error[") == 1
    assert "error[STATE-READ-ONLY]" in done.err or "error[STATE-WRITE-FAILED]" in done.err
    assert project.agent_runs() == []
    assert "error[" not in project.run("plan", "-target", "probe", status=0).err


def test_f09b_a_file_in_the_place_of_the_state_is_one_error_before_any_agent(project: Project) -> None:
    (project.folder / "state").write_text("mine\n")
    done = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert done.err.count("error[") == 1
    assert project.agent_runs() == []
    assert (project.folder / "state").read_text() == "mine\n"


def test_an_agent_that_makes_away_with_its_folder_has_failed_and_is_asked_again(project: Project) -> None:
    project.script = {"probe": [{"remove": True}, "good"]}
    project.apply("-target", "probe", status=0)
    assert project.nodes()["probe"]["attempts"] == 2


def test_a_folder_of_attempts_that_went_is_made_again(project: Project) -> None:
    project.apply("-target", "probe", status=0)
    shutil.rmtree(project.folder / ".octoform")
    project.apply("-target", "identify", status=0)
    assert project.stages_run() == ["probe", "probe", "identify"]  # the instances went with the folder
    assert (project.local / "instances.json").exists()
    assert Path(project.folder / ".octoform" / ".gitignore").read_text() == "*\n"
