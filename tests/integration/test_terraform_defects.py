"""Seven ways in which the leading planner is known to fail, each through the real command line.

1 a killed run records unfinished work as done; 2 a full disk cuts the state file; 3 secrets stand in state and output;
4 a saved plan applies the old configuration in silence; 5 a saved plan dies of unrelated changes and misses drift;
6 the plan over-reports; 7 `validate` hides most mistakes behind the first, and loses the column without colour.
"""

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
import warm
from bench_host import bench_host
from projects import Done, Project

FILLING = Path(__file__).parent / "disk_filling.py"
SECRET = 'hunter2-"quoted"-and-long'


def planned(project: Project, *arguments: str) -> dict[str, Any]:
    """The actions of a plan, node to action word, and the summary."""
    events = project.run("plan", "-json", *arguments, status=0).events()
    actions = {event["change"]["node"]: event["change"] for event in events if event["type"] == "planned_change"}
    return {**actions, "summary": next(event for event in events if event["type"] == "change_summary")}


def result(done: Done) -> dict[str, Any]:
    """The closing record of a run."""
    found: dict[str, Any] = done.events()[-1]["result"]
    return found


def edit(path: Path, before: str, after: str) -> None:
    text = path.read_text()
    assert before in text
    path.write_text(text.replace(before, after, 1))


def test_1_a_unit_whose_agent_was_running_at_kill_9_is_not_done_and_runs_again(project: Project) -> None:
    project.script = {"identify": [{"sleep": 120}]}
    project.write()
    process = project.start("apply", "-auto-approve", "-target", "interface")
    project.wait_for_agent(2)
    os.kill(process.pid, signal.SIGKILL)
    process.communicate(timeout=30)

    shown = json.loads(project.run("show", "-json", status=0).out)["nodes"]
    assert {name: node["status"] for name, node in shown.items()} == {"probe": "accepted", "identify": "interrupted"}
    plan = planned(project, "-target", "interface")
    assert set(plan) == {"identify", "interface", "summary"}
    assert plan["identify"]["reasons"][0]["cause"] == "interrupted"

    project.script = {}
    done = project.apply("-target", "interface", status=0)
    assert result(done)["agent_runs"] == 2
    assert project.stages_run() == ["probe", "identify", "identify", "interface"]
    assert {node["status"] for node in project.nodes().values()} == {"accepted"}


def fill(project: Project, point: str, number: int) -> "subprocess.CompletedProcess[str]":
    words = (str(project.folder), "identify", point, str(number))
    return warm.completed(FILLING, words, project.folder, project.environment())


@pytest.mark.parametrize(
    ("point", "number"),
    [("snapshot.start", 1), ("journal.success.start", 1), ("artifact.start", 2)],
)
def test_2_a_disk_that_fills_during_a_write_of_the_state_loses_nothing(
    project: Project, point: str, number: int
) -> None:
    project.apply("-target", "probe", status=0)
    before = (project.state / "state.json").read_bytes()
    project.write()
    edit(project.folder / "octopus.yaml", "version: 1\n", "version: 1\nmodel: some/other\n")
    done = fill(project, point, number)
    assert done.returncode == 0, done.stderr
    assert "STATE-DISK-FULL" in done.stderr
    assert not done.stdout.startswith("done")
    assert (project.state / "state.json").read_bytes() == before
    assert not [path for path in project.folder.rglob("*") if "octoform-tmp" in path.name]

    project.run("apply", "-auto-approve", "-target", "identify", status=0)
    nodes = project.nodes()
    assert {node["status"] for node in nodes.values()} == {"accepted"}
    assert {node["model"] for node in nodes.values()} == {"some/other"}
    assert json.loads((project.state / "state.json").read_bytes())["serial"] > json.loads(before)["serial"]


def test_3_the_value_of_a_named_variable_is_in_no_file_and_on_no_screen(project: Project) -> None:
    project.environ = {"BENCH_KEY": SECRET}
    project.env = ["BENCH_KEY"]
    project.script = {
        "probe": [{"echo": "BENCH_KEY", "exit": 1}, {"echo": "BENCH_KEY"}],
        "identify": [{"leak": "BENCH_KEY", "echo": "BENCH_KEY"}, {"leak": "BENCH_KEY", "escaped": True}],
    }
    project.manifest = {"budget": "{attempts: 2}"}
    done = project.apply("-target", "interface", status=1)
    assert done.codes().count("APPLY-SECRET-IN-OUTPUT") >= 2
    assert not (project.state / "identify").exists()
    found = done.text + project.run("plan", "-out", "saved.plan", status=0).text
    found += project.run("state", "show", "identify", status=0).text
    prompts = [path.read_text() for path in project.local.glob("attempts/*/prompt.md")]
    assert sum("[BENCH_KEY redacted]" in text for text in prompts) == 2
    assert "BENCH_KEY" in found
    spellings = (SECRET, json.dumps(SECRET)[1:-1], "".join(f"\\u{ord(sign):04x}" for sign in SECRET))
    for spelling in spellings:
        assert spelling not in found
        for path in project.folder.rglob("*"):
            assert path.is_dir() or spelling.encode() not in path.read_bytes(), path


def test_4_a_manifest_that_was_edited_after_the_plan_was_saved_is_refused_part_by_part(project: Project) -> None:
    project.write()
    project.run("plan", "-target", "interface", "-out", "saved.plan", status=0)
    project.manifest = {"stages": "{identify: {model: some/other-model}}"}
    project.write()
    done = project.run("apply", "-json", "saved.plan", status=1)
    diagnostics = [event["diagnostic"] for event in done.events() if event["type"] == "diagnostic"]
    stale = [item for item in diagnostics if item["severity"] == "error"]
    assert [item["code"] for item in stale] == ["PLAN-STALE"]
    assert stale[0]["summary"] == "identify: model moved since the plan was saved"
    assert stale[0]["detail"] == "model: (none) -> some/other-model"
    assert result(done)["refused"] == ["identify"]
    assert project.stages_run() == ["probe"]
    assert set(project.nodes()) == {"probe"}


def test_5_a_saved_plan_survives_an_unrelated_change_and_refuses_only_what_moved(
    project: Project, tmp_path: Path
) -> None:
    sysroot = bench_host(tmp_path / "sysroot")
    device = sysroot / "sys" / "bus" / "usb" / "devices" / "1-1"
    (device / "modalias").write_text("usb:v0A0Ap0001\n")
    project.environ = {"OCTOFORM_SYSROOT": str(sysroot)}
    specs = project.own_specs()
    project.apply("-target", "interface", status=0)

    edit(specs / "interface.md", "INTERFACE", "Interface")
    project.run("plan", "-target", "interface", "-out", "good.plan", status=0)
    serial = json.loads((project.state / "state.json").read_bytes())["serial"]
    project.run("state", "adopt", "identify", status=0)
    assert json.loads((project.state / "state.json").read_bytes())["serial"] == serial + 1
    done = project.run("apply", "-json", "good.plan", status=0)
    assert result(done)["agent_runs"] == 1

    # Both ends of the chain are to run: PROBE on request, INTERFACE for its spec.
    edit(specs / "interface.md", "Interface", "The interface")
    project.run("plan", "-target", "interface", "-replace", "probe", "-out", "drift.plan", status=0)
    (device / "modalias").write_text("usb:v0A0Ap0002\n")
    done = project.run("apply", "-json", "drift.plan", status=1)
    diagnostics = [event["diagnostic"] for event in done.events() if event["type"] == "diagnostic"]
    stale = [item for item in diagnostics if item["severity"] == "error"]
    assert {item["code"] for item in stale} == {"PLAN-STALE"}
    assert any(item["summary"].startswith("probe: hardware moved") for item in stale)
    assert "->" in stale[0]["detail"]
    assert "usb:v0A0Ap0002" in stale[0]["detail"]
    assert "probe" in result(done)["refused"]
    assert result(done)["agent_runs"] == 0

    # What does not rest on the hardware is applied although the hardware moved.
    (device / "modalias").write_text("usb:v0A0Ap0001\n")
    project.run("plan", "-target", "interface", "-out", "some.plan", status=0)
    (device / "modalias").write_text("usb:v0A0Ap0003\n")
    done = project.run("apply", "-json", "some.plan", status=0)
    assert project.stages_run()[-1] == "interface"


def test_6_the_plan_says_at_most_and_maybe_and_the_apply_stays_within(project: Project) -> None:
    specs = project.own_specs()
    project.apply("-target", "interface", status=0)
    edit(specs / "probe.md", "PROBE", "Probe")
    plan = project.run("plan", "-target", "interface", status=0).out
    assert "at most 3" in plan
    assert "maybe 1" in plan
    summary = planned(project, "-target", "interface")["summary"]
    assert summary["changes"] == {"add": 0, "change": 1, "remove": 0, "maybe": 2, "operation": "apply"}
    assert (summary["agent_runs"]["at_most"], summary["agent_runs"]["maybe"]) == (3, 1)
    done = project.apply("-target", "interface", status=0)
    assert (result(done)["changed"], result(done)["alike"]) == (0, 1), "made again, with the same output"
    assert result(done)["agent_runs"] == 1
    assert [event["node"] for event in done.events() if event["type"] == "apply_unchanged"] == ["identify", "interface"]

    edit(specs / "identify.md", "IDENTIFY", "Identify")
    project.script = {"identify": [{"mutate": [[["devices", 0, "confidence"], 0.8]]}]}
    done = project.apply("-target", "interface", status=0)
    assert (result(done)["changed"], result(done)["alike"]) == (1, 1)
    assert project.stages_run()[-2:] == ["identify", "interface"]
    assert "No changes" in project.run("plan", "-target", "interface", status=0).out


def test_7_validate_tells_the_mistakes_of_all_phases_at_once_with_codes_and_columns(project: Project) -> None:
    specs = project.own_specs()
    edit(specs / "identify.md", "stage: identify", "stage: identfy")
    profile = project.folder / "profiles" / "camera.md"
    profile.parent.mkdir()
    profile.write_text("---\nname: camera\nabout: a camera\nevidense: {}\n---\nLook at it.\n")
    (project.folder / "octopus.yaml").write_text(
        "version: 1\nhost: bench\nharnes: builtin\nbudget: {attempts: many}\nprofiles: [profiles/camera.md, no.md]\n"
    )
    done = project.run("validate", status=1)
    assert "\x1b" not in done.text
    for line in (
        "error[MANIFEST-UNKNOWN-KEY]",
        "error[MANIFEST-WRONG-TYPE]",
        "error[MANIFEST-MISSING-PROFILE]",
        "error[PROTOCOL-FIELD]",
        "error[PROFILE-FIELD]",
        "octopus.yaml:3:1",
        "octopus.yaml:4:20",
        "octopus.yaml:5:",
        "protocol/identify.md:2:8",
        "profiles/camera.md:4:",
        "help: did you mean `harness`?",
    ):
        assert line in done.text
    lines = done.text.splitlines()
    assert [lines[number + 1].index("^") - lines[number].index("m") for number in places(lines, "attempts: many")] == [
        lines[places(lines, "attempts: many")[0]].index("many") - lines[places(lines, "attempts: many")[0]].index("m")
    ]
    machine = json.loads(project.run("validate", "-json", status=1).out)
    assert len(machine["diagnostics"]) == machine["error_count"] >= 6
    assert all(item["code"] and item["path"] for item in machine["diagnostics"])
    assert not project.state.exists()


def places(lines: list[str], text: str) -> list[int]:
    return [number for number, line in enumerate(lines) if text in line]
