"""What an agent may leave behind and must not get through: one fault each, injected through the real command line."""

import json
import time
from pathlib import Path

import pytest
from projects import Project

INVENTED = {
    "id": "usb-9999-0001",
    "identified_as": "a robot arm",
    "category": "actuator",
    "confidence": 0.9,
    "method": "web_search",
    "evidence": [{"quote": "arm"}],
    "capabilities": [],
}
PASSTHROUGH = {
    "name": "send_serial_command",
    "description": "Send raw bytes.",
    "via": "pyserial",
    "effect": "actuate",
}

REFUSALS: dict[str, dict[str, tuple[dict[str, object], str]]] = {
    "probe": {
        "F01 invalid JSON": ({"write": '{"format": 1,'}, "ARTIFACT-NOT-JSON"),
        "F07a white space": ({"write": " \n\t\n"}, "ARTIFACT-EMPTY"),
        "F08 exit 3": ({"write": '{"half"', "exit": 3}, "APPLY-AGENT-FAILED"),
        "no output": ({"exit": 0}, "ARTIFACT-MISSING"),
        "F40 link": ({"link": "/etc/hostname"}, "ARTIFACT-LINK"),
    },
    "identify": {
        "F02 schema": ({"mutate": [[["devices", 0, "category"], "gadget"]]}, "IDENTIFY-SCHEMA"),
        "F03 invented arm": ({"mutate": [[["devices", 2], INVENTED]]}, "IDENTIFY-INVENTED-DEVICE"),
        "F04 passthrough": (
            {"mutate": [[["devices", 0, "capabilities", 1], PASSTHROUGH]]},
            "IDENTIFY-PASSTHROUGH",
        ),
    },
    "interface": {"missing tool": ({"mutate": [[["tools"], []]]}, "INTERFACE-CAPABILITY-WITHOUT-TOOL")},
}
"""By stage; each is one attempt."""


@pytest.mark.parametrize("stage", REFUSALS)
def test_is_refused_by_name_and_the_run_stops(project: Project, stage: str) -> None:
    refusals = REFUSALS[stage]
    project.script = {stage: [behaviour for behaviour, _ in refusals.values()]}
    project.manifest = {"budget": f"{{attempts: {len(refusals)}}}"}
    done = project.apply("-target", "interface", status=1)
    lines = [
        {item["code"] for item in event["diagnostics"]}
        for event in done.events()
        if event["type"] == "attempt_errored" and event["node"] == stage
    ]
    found = dict(zip(refusals, lines, strict=True))
    assert {name: codes for name, codes in found.items() if refusals[name][1] not in codes} == {}
    assert not (project.state / stage).exists()
    assert [run["stage"] for run in project.agent_runs()][-1] == stage
    assert project.nodes()[stage]["status"] == "failed"


def test_f08b_output_of_a_failed_attempt_is_never_seen_again(project: Project) -> None:
    project.script = {"probe": [{"write": '{"format": 1, "half', "sleep": 30}, {"exit": 1}]}
    project.manifest = {"budget": "{attempts: 2, attempt_timeout: 1s}"}
    done = project.apply("-target", "probe", status=1)
    assert {"APPLY-TIMEOUT", "APPLY-AGENT-FAILED"} <= set(done.codes())
    assert not (project.state / "probe").exists()


def gone(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def test_f07_a_hanging_agent_and_its_grandchild_in_another_session_are_gone(project: Project) -> None:
    project.script = {"probe": [{"grandchild": 300, "sleep": 300}]}
    project.manifest = {"budget": "{attempts: 1, attempt_timeout: 2s}"}
    started = time.monotonic()
    done = project.apply("-target", "probe", status=1)
    assert "APPLY-TIMEOUT" in done.codes()
    assert time.monotonic() - started < 30
    assert gone(int((project.attempts("probe")[0] / "grandchild.pid").read_text()))
    assert gone(project.agent_runs()[0]["pid"])


def test_what_a_successful_agent_leaves_running_is_ended_too(project: Project) -> None:
    project.script = {"probe": [{"grandchild": 300, "copy": str(good("probe"))}]}
    project.apply("-target", "probe", status=0)
    assert gone(int((project.attempts("probe")[0] / "grandchild.pid").read_text()))


def good(stage: str) -> Path:
    return Path(__file__).parents[1] / "agent" / "good" / f"{stage}.json"


def test_f23_a_spent_stage_budget_is_a_failed_stage_and_stops_the_run(project: Project) -> None:
    project.script = {"probe": [{"sleep": 60}]}
    project.manifest = {"budget": "{attempts: 5, attempt_timeout: 2s, stage_timeout: 4s}"}
    done = project.apply("-target", "identify", status=1)
    assert "APPLY-BUDGET-SPENT" in done.codes()
    assert {run["stage"] for run in project.agent_runs()} == {"probe"}
    assert len(project.agent_runs()) == 2


def test_f27_a_program_that_is_not_installed_is_one_line_and_no_retry(project: Project) -> None:
    project.write()
    (project.folder / "octopus.yaml").write_text(
        "version: 1\nhost: bench\nharness: {name: command, command: [no-such-agent-anywhere]}\n"
    )
    done = project.run("apply", "-auto-approve", "-target", "probe", status=1)
    assert "no-such-agent-anywhere" in done.err
    assert "the agent of probe could not be started" in done.err
    assert len(project.attempts("probe")) <= 1


def test_f28_a_failed_probe_keeps_the_last_good_one(project: Project) -> None:
    project.apply("-target", "probe", status=0)
    before = (project.state / "probe" / "output.json").read_bytes()
    project.script = {"probe": [{"exit": 1}]}
    project.manifest = {"budget": "{attempts: 1}"}
    project.apply("-target", "probe", "-replace", "probe", status=1)
    assert (project.state / "probe" / "output.json").read_bytes() == before
    project.script = {}
    project.apply("-target", "probe", status=0)
    assert project.nodes()["probe"]["status"] == "accepted"


def test_f29_what_is_written_outside_of_the_attempt_is_undone_and_fails_it(project: Project) -> None:
    """Octoform's own records are no more the agent's than its sources; nor is another stage's spec, which a person
    might promote."""
    project.apply("-target", "identify", status=0)
    own = ["instances.json", "specs/serve.json", "endpoint/launch", "attempts/000001-probe-1/attempt.json"]
    names = ["octopus.yaml", "state/bench/probe/output.json", *(f".octoform/bench/{name}" for name in own)]
    files = [project.folder / name for name in names]
    project.script = {"identify": [{"touch": [str(path) for path in files]}, "good"]}
    project.write()
    before = {path: path.read_bytes() if path.exists() else None for path in files}
    for path in files:
        path.parent.mkdir(exist_ok=True)
    done = project.run("apply", "-auto-approve", "--json", "-target", "identify", "-replace", "identify", status=0)
    refused = next(event for event in done.events() if event["type"] == "attempt_errored")
    assert {item["code"] for item in refused["diagnostics"] if item["severity"] == "error"} == {"APPLY-OUTSIDE-WRITE"}
    assert {item["path"] for item in refused["diagnostics"] if item["severity"] == "error"} == set(names)
    assert {path: path.read_bytes() if path.exists() else None for path in files} == before
    assert project.nodes()["identify"]["attempts"] == 2
    undone = project.attempts("identify")[1] / "undone" / ".octoform" / "bench"
    assert (undone / "specs" / "serve.json").read_text() == "touched by the agent\n"
    assert json.loads(project.run("spec", "diff", "-json", status=0).out)["edits"] == []


def test_f35_f38_attempts_that_fail_and_their_logs_reach_the_next_prompt_bounded(project: Project) -> None:
    flood = {"say": "x" * 3_000_000 + "\x1b[31m\u202e", "exit": 2}
    invented = {"mutate": [[["devices", 2], INVENTED]]}
    project.script = {"probe": [{"exit": 1}, {"exit": 0}, flood, "good"], "identify": [flood, invented, "good"]}
    project.manifest = {"budget": "{attempts: 4}"}
    project.apply("-target", "identify", status=0)
    assert {name: node["attempts"] for name, node in project.nodes().items()} == {"probe": 4, "identify": 3}
    for attempt in (project.attempts("probe")[3], project.attempts("identify")[1]):
        prompt = (attempt / "prompt.md").read_bytes()
        assert len(prompt) <= 48 * 1024
        assert b"\x1b" not in prompt
        assert "\u202e" not in prompt.decode()
    refused = (project.attempts("identify")[2] / "prompt.md").read_text()
    assert "IDENTIFY-INVENTED-DEVICE" in refused and "usb-9999-0001" in refused


def test_f36_a_stage_that_fails_all_attempts_stops_the_run(project: Project) -> None:
    project.script = {"identify": [{"exit": 1}]}
    done = project.apply("-target", "interface", status=1)
    assert [run["stage"] for run in project.agent_runs()] == ["probe", "identify", "identify", "identify"]
    assert project.nodes()["probe"]["status"] == "accepted"
    assert json.loads(done.out.splitlines()[-1])["result"]["failed"] == "identify"
    assert [path.name for path in (project.state / "probe").iterdir()] == ["output.json"]
