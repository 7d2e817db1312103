"""A run is recorded, and the recording played elsewhere: the same failures, the same artifacts, and no agent.

Every folder below tests/cases/recordings is a recording that is played here. Those whose names begin with ``laptop``
and ``rig`` were made by coding agents with a language model that got the five shipped specs and nothing else, on the
planted host of that name and on the simulated reference rig.
"""

import contextlib
import importlib.metadata
import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project

from octoform.harness.recording import Recording, load
from octoform.simulation.rig import Rig
from octoform.simulation.rig import load as described

pytestmark = pytest.mark.dear

CASES = Path(__file__).parents[1] / "cases" / "recordings"
HOSTS = Path(__file__).parents[1] / "hosts"
STAGES = ("probe", "identify", "interface", "serve", "deploy")
SERIAL = "BT-00017-X"
SCRIPT: dict[str, list[object]] = {
    "probe": [{"mutate": [[["devices", 0, "id"], "hwmon-bt-00017-x"]], "say": f"I see {SERIAL}"}, "good"],
    "identify": [{"write": "{"}, {"exit": 3}, {"edit_spec": "Mind the braces.", "say": "a spec was wrong"}],
    "serve": [{"link": "/etc/passwd"}, "good"],
}


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> tuple[Project, Done]:
    """A project whose agent failed in several ways before each stage was accepted."""
    folder = tmp_path_factory.mktemp("original")
    project = Project(folder / "project", folder / "outside", script=SCRIPT)
    project.share_environments(environments)
    done = project.apply(status=0)
    project.run("attempts", "record", str(folder / "recording"), status=0)
    return project, done


@pytest.fixture(scope="module")
def recording(original: tuple[Project, Done]) -> Path:
    return original[0].folder.parent / "recording"


def replaying(tmp_path: Path, recording: Path) -> Project:
    """A new project that plays a recording; no program can be found on its PATH."""
    folder = tmp_path / "elsewhere"
    shutil.copytree(recording, folder / "recordings" / "run")
    (tmp_path / "empty").mkdir()
    return Project(
        folder,
        tmp_path / "outside",
        harness="{name: replay, recording: recordings/run}",
        environ={"PATH": str(tmp_path / "empty")},
    )


def artifact(project: Project, stage: str) -> bytes:
    return (project.state / stage / ("server.py" if stage == "serve" else "output.json")).read_bytes()


def attempts(project: Project) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(project.run("attempts", "-all", "-json", status=0).out)["attempts"]
    return found


@pytest.mark.slow
def test_a_replay_fails_where_the_run_failed_and_ends_where_it_ended(
    original: tuple[Project, Done], recording: Path, environments: Path, tmp_path: Path
) -> None:
    project, done = original
    agents = len(project.agent_runs())
    replay = replaying(tmp_path, recording)
    replay.share_environments(environments)
    again = replay.apply(status=0)
    # A replay has no agent, and the host that the recorded one was on is elsewhere.
    elsewhere = {"HARNESS-UNCONFINED", "PROBE-DEVICE-UNKNOWN", "PROBE-DEVICE-MISSING", "ENDPOINT-TOOL-NOT-TRIED"}
    codes = [[code for code in run.codes() if code not in elsewhere] for run in (again, done)]
    assert codes[0] == codes[1]
    assert {"PROBE-SERIAL-IN-ID", "ARTIFACT-NOT-JSON", "APPLY-AGENT-FAILED", "ARTIFACT-LINK"} <= set(done.codes())
    for stage in STAGES:
        assert artifact(replay, stage) == artifact(project, stage), stage
    ended = [(item["stage"], item["attempt"], item["state"]) for item in attempts(replay)]
    assert ended == [(item["stage"], item["attempt"], item["state"]) for item in attempts(project)]
    edits = [item["spec_edit"] for item in attempts(replay) if item["spec_edit"] is not None]
    assert [(item["permitted"], item["added"]) for item in edits] == [(True, 1)]
    assert len(project.agent_runs()) == agents, "the recorded agent was started"
    assert list(replay.local.glob("attempts/*/process.json")) == [], "a program was started for an attempt"
    assert "0 added, 0 changed, 0 destroyed" in replay.run("apply", "-auto-approve", status=0).out
    assert replay.run("plan", "-detailed-exitcode").status == 0


def test_a_recording_holds_nothing_of_its_host_and_is_the_same_twice(
    original: tuple[Project, Done], recording: Path, tmp_path: Path
) -> None:
    project, _ = original
    files = {path.relative_to(recording): path.read_bytes() for path in recording.rglob("*") if path.is_file()}
    for name, data in files.items():
        for secret in (SERIAL, SERIAL.lower(), str(project.folder), '"bench"'):
            assert secret.encode() not in data or (name.parts[0], secret) == ("serve-2", '"bench"'), (name, secret)
    project.run("attempts", "record", str(tmp_path / "again"), status=0)
    assert {path: (tmp_path / "again" / path).read_bytes() for path in files} == files


def test_the_command_line_refuses_and_explains(original: tuple[Project, Done], recording: Path, tmp_path: Path) -> None:
    project, _ = original
    refused = project.run("attempts", "record", str(project.folder), status=1)
    assert "RECORD-FOLDER" in refused.err
    document = json.loads(project.run("attempts", "record", "-json", str(tmp_path / "x"), status=0).out)
    assert document["stages"] == {"probe": 2, "identify": 3, "interface": 1, "serve": 2, "deploy": 1}
    assert "RECORD-NOTHING" in project.run("attempts", "record", str(tmp_path / "y"), "-from", "99", status=1).err
    shown = project.run("attempts", "show", "1", status=0).out
    assert "error[PROBE-SERIAL-IN-ID]" in shown
    assert json.loads(project.run("attempts", "-json", "show", "2", status=0).out)["state"] == "accepted"
    assert "ATTEMPT-UNKNOWN" in project.run("attempts", "show", "99", status=1).err
    assert "did you mean serve?" in project.run("attempts", "-stage", "serv", status=1).err
    assert project.run("attempts", "-stage", "serve", status=0).out.count("serve") == 2


def test_a_recording_without_a_stage_stops_there_and_says_why(
    recording: Path, environments: Path, tmp_path: Path
) -> None:
    replay = replaying(tmp_path, recording)
    replay.share_environments(environments)
    path = replay.folder / "recordings" / "run" / "recording.json"
    document = json.loads(path.read_text())
    del document["stages"]["identify"]
    path.write_text(json.dumps(document))
    done = replay.apply(status=1)
    assert "the recording has no attempt of identify" in done.text
    assert len(replay.attempts("identify")) == 1
    path.write_text("{}")
    assert "HARNESS-RECORDING-BROKEN" in replay.apply(status=1).text


def fitted(recording: Path, folder: Path) -> Path:
    """A copy whose DEPLOY names the versions that are installed here: packages of a test come from a cache."""
    shutil.copytree(recording, folder)
    for path in folder.glob("deploy-*/output.json"):
        document = json.loads(path.read_text())
        for item in document["requirements"]:
            with contextlib.suppress(importlib.metadata.PackageNotFoundError):
                item["version"] = importlib.metadata.version(item["name"])
        path.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n")
    return folder


def required(recording: Path) -> set[str]:
    """The packages that its DEPLOY chose."""
    return {
        item["name"] for item in json.loads(max(recording.glob("deploy-*/output.json")).read_text())["requirements"]
    }


@pytest.mark.slow
@pytest.mark.parametrize("case", sorted({*CASES.iterdir()} - {*CASES.glob("rig-*")}), ids=lambda path: path.name)
def test_every_recording_leads_to_its_own_artifacts(
    case: Path,
    environments: Path,
    packaged: Callable[..., Path],
    tmp_path: Path,
    planted: Callable[..., Path],
) -> None:
    found = load(case)
    assert isinstance(found, Recording), found
    recording = fitted(case, tmp_path / "fitted")
    replay = replaying(tmp_path, recording)
    more = required(recording) - {"fastmcp", "pydantic"}
    replay.share_environments(packaged(*sorted(more)) if more else environments)
    host = case.name.partition("-")[0]
    if (HOSTS / f"{host}.host").exists():
        replay.environ["OCTOFORM_SYSROOT"] = str(planted(host))
    replay.apply(status=0)
    for stage in STAGES:
        last = found.stages[stage][-1].output
        assert last is not None and last.file is not None
        assert artifact(replay, stage) == (recording / last.file).read_bytes(), stage
    assert [item["state"] for item in attempts(replay)].count("accepted") == len(STAGES)
    assert len(attempts(replay)) == sum(map(len, found.stages.values()))
    assert "0 added, 0 changed, 0 destroyed" in replay.run("apply", "-auto-approve", status=0).out


ARM, RAIL = "usb-1a86-55d3", "usb-2341-804f"
PROFILED = {"profiles": "[so-arm101, camera-rail]", "answers": f"{{{RAIL}: the camera rail of the bench}}"}


@contextlib.contextmanager
def rig_of(case: str, packaged: Callable[..., Path], tmp_path: Path, **manifest: str) -> Iterator[tuple[Project, Rig]]:
    """What the coding agent's run on the rig ended in, and the rig."""
    description = described("reference")
    description["devices"]["arm"]["speedup"] = description["devices"]["rail"]["speedup"] = 8
    serials = {ARM: description["devices"]["arm"], RAIL: description["devices"]["rail"]}
    rig = Rig(description, tmp_path / "tree")
    rig.start()
    try:
        recording = fitted(CASES / case, tmp_path / "fitted")
        [path] = recording.glob("probe-*/output.json")
        probe = json.loads(path.read_text())
        for device in probe["devices"]:  # a recording has pseudonyms in place of serial numbers
            if "serial" in device["instance"]:
                device["instance"]["serial"] = serials[device["id"]]["strings"]["serial"]
        path.write_text(json.dumps(probe))
        project = replaying(tmp_path, recording)
        # Of a folder of its own: the ranges of this agent's server lock other environments than the embedded agent's.
        project.share_environments(packaged(*sorted(required(recording) - {"fastmcp"})))
        project.environ["OCTOFORM_SYSROOT"] = str(tmp_path / "tree")
        project.manifest |= manifest
        project.apply(status=0)
        assert [item["state"] for item in attempts(project)] == ["accepted"] * len(STAGES)
        yield project, rig
        project.run("stop", status=0)
    finally:
        rig.stop()


@pytest.mark.slow
def test_without_a_profile_no_tool_of_a_coding_agent_reaches_the_arm(
    packaged: Callable[..., Path], tmp_path: Path
) -> None:
    with rig_of("rig-without-profile", packaged, tmp_path) as (project, rig):
        tools = json.loads((project.state / "interface" / "output.json").read_text())["tools"]
        assert {tool["effect"] for tool in tools} == {"read"}
        assert [tool["name"] for tool in tools if ARM in tool["devices"]] == ["check_presence"]
        for tool in tools:
            project.run("call", tool["name"], status=0)
        assert project.run("call", "arm_move_joint", "-arg", "joint=gripper", "-arg", "position=2100").status != 0
        assert rig.servos is not None and rig.servos.received == 0, "a byte went to the arm"
        assert rig.line is not None and rig.line.lines == []


@pytest.mark.slow
def test_with_its_profile_the_arm_moves_by_a_coding_agents_tools(packaged: Callable[..., Path], tmp_path: Path) -> None:
    with rig_of("rig-with-profiles", packaged, tmp_path, policy="{actuate: allow}", **PROFILED) as (project, rig):
        assert rig.servos is not None and rig.line is not None
        project.run("call", "arm_move_joint", "-arg", "joint=gripper", "-arg", "position=2300", status=0)
        assert abs(rig.servos.servos[6].position - 2300) < 30
        project.run("call", "rail_home", status=0)
        project.run("call", "rail_move_x", "-arg", "steps=120", status=0)
        assert rig.line.lines == ["HOME", "MOVE_X 120"] and rig.line.position["X"] == 120
