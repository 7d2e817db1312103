"""The life of one host through the real command line, on one live project that every test leaves in sync.

The agent is scripted and instantaneous; environment, server and client are real.
"""

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from projects import Project

pytestmark = pytest.mark.dear


def summary(project: Project, *arguments: str) -> dict[str, Any]:
    """The `change_summary` of a plan."""
    events = project.run("plan", "-json", *arguments, status=0).events()
    return next(event for event in events if event["type"] == "change_summary")


def reasons(project: Project) -> dict[str, list[str]]:
    """Node to the sentences that the plan gives for it."""
    events = project.run("plan", "-json", status=0).events()
    return {event["change"]["node"]: event["reasons_text"] for event in events if event["type"] == "planned_change"}


def repair(project: Project) -> list[str]:
    """Apply; the stages whose agent ran, after which nothing is left to do."""
    before = len(project.agent_runs())
    project.run("apply", "-auto-approve", status=0)
    assert project.run("plan", "-detailed-exitcode").status == 0
    return project.stages_run()[before:]


def reword(project: Project, stage: str) -> None:
    """Put one more word into the project's own spec of a stage."""
    with (project.folder / "protocol" / f"{stage}.md").open("a") as spec:
        spec.write("Again.\n")


@pytest.fixture
def live_alone(live: Project, compiled: Path) -> Project:
    """The same with an environment of its own, which may be spoilt or destroyed."""
    if (live.local / "environments").is_symlink():
        live.take_environments(compiled)
        live.kept_servers = True
    return live


def test_the_second_apply_starts_no_agent_and_changes_nothing(live: Project) -> None:
    before = (live.state / "state.json").read_bytes()
    assert live.stages_run()[:5] == ["probe", "identify", "interface", "serve", "deploy"]
    runs = len(live.agent_runs())
    done = live.run("apply", "-auto-approve", status=0)
    assert "0 added, 0 changed, 0 destroyed" in done.out
    assert len(live.agent_runs()) == runs
    assert (live.state / "state.json").read_bytes() == before


def test_plan_without_work_is_quiet_and_writes_nothing(live: Project) -> None:
    before = {path: path.stat().st_mtime_ns for path in live.folder.rglob("*")}
    done = live.run("plan", "-detailed-exitcode", status=0)
    assert "No changes." in done.out
    assert done.err == ""
    assert "\x1b" not in done.out
    assert {path: path.stat().st_mtime_ns for path in live.folder.rglob("*")} == before


def test_the_state_can_be_looked_at(live: Project) -> None:
    assert "deploy" in live.run("show", status=0).out
    assert live.run("state", "list", status=0).out.split() == [
        *("probe", "identify", "interface", "serve", "deploy", "endpoint")
    ]
    node = json.loads(live.run("state", "show", "-json", "serve", status=0).out)
    assert node["harness"] == "command"
    assert {"spec", "harness", "input.interface"} <= set(node["key_parts"])
    wrong = live.run("state", "show", "serv", status=1)
    assert "STATE-NO-NODE" in wrong.err
    assert "did you mean serve?" in wrong.err


def test_the_graph_can_be_drawn(live: Project) -> None:
    dot = live.run("graph", status=0).out
    assert dot.startswith("digraph octoform {")
    assert dot.count("->") == 12
    assert '"deploy" -> "serve" [style = dotted];' in dot
    assert live.run("graph", "-type", "mermaid", status=0).out.startswith("flowchart LR\n")


def test_explain_schema_and_usage(live: Project) -> None:
    assert "IDENTIFY-INVENTED-DEVICE" in live.run("explain", "IDENTIFY-INVENTED-DEVICE", status=0).out
    assert "EXPLAIN-UNKNOWN-CODE" in live.run("explain", "IDENTIFY-INVENTED-DEVIC", status=1).err
    assert json.loads(live.run("schema", status=0).out)["type"] == "object"
    assert live.run("paln", status=1).out == ""
    assert live.run("plan", "-target", "sreve", status=1).err.count("did you mean serve?") == 1
    assert live.run("--help", status=0).err == ""


def test_status_and_tools_of_the_live_endpoint(live: Project) -> None:
    status = json.loads(live.run("status", "-json", status=0).out)
    assert (status["in_sync"], status["health"], status["tools"]) == (True, "healthy", ["read_temperature"])
    assert status["reasons"] == []
    tools = json.loads(live.run("tools", "-json", status=0).out)["tools"]
    assert [(tool["name"], tool["effect"]) for tool in tools] == [("read_temperature", "read")]


def test_a_call_answers_and_wrong_calls_say_what_is_right(live: Project) -> None:
    answer = json.loads(live.run("call", "read_temperature", "-arg", "digits=0", "-json", status=0).out)
    assert answer["structured"] == {"celsius": 22.0}
    wrong = live.run("call", "read_temperature", "-json", '{"digit": 1}', status=1)
    assert "ENDPOINT-BAD-ARGUMENT" in wrong.text
    assert "digits" in wrong.text
    assert "CALL-BAD-ARGUMENT" in live.run("call", "read_temperature", "-arg", "digits", status=1).err
    assert "is no duration" in live.run("call", "read_temperature", "-timeout", "soon", status=1).err
    log = (live.local / "log" / "octoform.jsonl").read_text().splitlines()
    assert json.loads(log[-1])["event"] == "result"


def test_a_word_of_a_spec_is_named_and_the_wave_stops_where_the_output_is_the_same(live: Project) -> None:
    reword(live, "identify")
    shown = live.run("plan", "-detailed-exitcode", status=2).out
    assert "identify" in shown
    assert "spec" in shown
    assert "maybe 1" in shown
    changes = summary(live)["changes"]
    assert (changes["add"], changes["change"], changes["maybe"]) == (0, 1, 4)
    assert repair(live) == ["identify"]


def test_accept_adopts_an_artifact_under_a_changed_spec(live: Project) -> None:
    reword(live, "identify")
    assert set(reasons(live)) == {"identify", "interface", "serve", "deploy", "endpoint"}
    before = len(live.agent_runs())
    live.run("state", "adopt", "identify", status=0)
    assert "No changes" in live.run("plan", status=0).out
    assert len(live.agent_runs()) == before
    assert json.loads(live.run("state", "show", "-json", "identify", status=0).out)["detail"]["adopted"] is True


def test_accept_adopts_an_edit_by_hand_only_when_the_contract_does(live: Project) -> None:
    path = live.state / "identify" / "output.json"
    good = path.read_bytes()
    path.write_bytes(good.replace(b'"sensor"', b'"gadget"'))
    assert "IDENTIFY-SCHEMA" in live.run("state", "adopt", "identify", status=1).err
    path.unlink()
    assert "ARTIFACT-MISSING" in live.run("state", "adopt", "identify", status=1).err
    path.write_bytes(good.replace(b'"confidence": 0.9', b'"confidence": 0.91'))
    live.run("state", "adopt", "identify", status=0)
    assert repair(live) == ["interface"]


def test_a_saved_plan_is_shown_and_applied_as_it_was_saved(live: Project) -> None:
    reword(live, "interface")
    done = live.run("plan", "-out", "saved.plan", "-detailed-exitcode", status=2)
    assert "octoform apply saved.plan" in done.out
    assert "interface" in live.run("show", "saved.plan", status=0).out
    before = len(live.agent_runs())
    live.run("apply", "saved.plan", status=0)
    assert live.stages_run()[before:] == ["interface"]
    again = live.run("apply", "saved.plan", status=1)
    assert "PLAN-STALE" in again.err
    assert len(live.agent_runs()) == before + 1
    (live.folder / "saved.plan").write_text("{}")
    assert "PLAN-NOT-A-PLAN" in live.run("apply", "saved.plan", status=1).err
    (live.folder / "saved.plan").unlink()


def test_a_server_that_was_edited_is_not_served_and_made_again(live: Project) -> None:
    server = live.state / "serve" / "server.py"
    good = server.read_bytes()
    server.write_bytes(good.replace(b"value / 1000", b"value * 1000"))
    refused = json.loads(live.run("status", "-json", status=3).out)
    # The process goes on with what it was started with; the edited code is never run.
    assert (refused["in_sync"], refused["health"]) == (False, "degraded")
    assert "server.py is not the one that the endpoint was made for" in refused["reasons"]
    assert json.loads(live.run("call", "read_temperature", "-json", status=0).out)["structured"]["celsius"] == 21.5
    assert "is not the file that was accepted" in live.run("restart", status=1).err
    found = reasons(live)
    assert any("edited by hand" in text for text in found["serve"])
    assert any("server.py" in text for text in found["endpoint"])
    assert repair(live) == ["serve"]
    assert server.read_bytes() == good


def test_what_is_damaged_or_forgotten_of_an_endpoint_is_named_and_made_again_without_an_agent(
    live_alone: Project, packaged: Callable[..., Path]
) -> None:
    """One damage after the other, each seen by itself; one apply then mends them all."""
    live = live_alone
    launcher = live.local / "endpoint" / "launch"
    launcher.unlink()
    found = reasons(live)
    assert list(found) == ["endpoint"]
    assert any("launcher is missing" in text for text in found["endpoint"])

    environment = Path(json.loads((live.local / "endpoint" / "manifest.json").read_text())["environment"])
    package = next(environment.glob("lib/python*/site-packages/fastmcp-*.dist-info"))
    shutil.rmtree(package)
    found = reasons(live)
    assert list(found) == ["endpoint"]
    assert any("fastmcp" in text and "is gone from the serving environment" in text for text in found["endpoint"])

    live.run("state", "rm", "endpoint", status=0)
    assert (live.local / "endpoint" / "manifest.json").exists()
    assert list(reasons(live)) == ["endpoint"]

    with live.borrowed_bytecode(packaged("pyserial")):
        assert repair(live) == []
    assert os.access(launcher, os.X_OK)
    assert next(environment.glob("lib/python*/site-packages/fastmcp-*.dist-info"), None)
    assert live.nodes()["endpoint"]["status"] == "accepted"


def test_destroy_is_refused_without_approval_and_by_prevent_destroy(live: Project) -> None:
    assert "APPLY-NOT-APPROVED" in live.run("destroy", status=1).err
    live.manifest = {"lifecycle": "{prevent_destroy: true}"}
    live.write()
    assert "PLAN-PREVENT-DESTROY" in live.run("destroy", "-auto-approve", status=1).err
    live.manifest = {}
    live.write()
    assert live.run("plan", "-detailed-exitcode").status == 0


def test_destroy_takes_away_what_is_ours_and_nothing_else(live_alone: Project) -> None:
    live = live_alone
    mine = [live.folder / "notes.md", live.state / "notes.md", live.local / "endpoint" / "mine.txt"]
    for path in mine:
        path.write_text("mine\n")
    assert summary(live, "-destroy")["changes"]["remove"] == 6
    live.environ["HOME"] = str(live.outside / "home")
    live.run("clients", "install", "cursor", status=0)
    latch = live.local / "run" / "estop.json"
    latch.write_text('{"format": 1, "by": "ada", "reason": "arm at the window", "since": ""}')
    done = live.run("destroy", "-auto-approve", status=0)
    assert "6 destroyed" in done.out
    assert "DESTROY-ESTOP-KEPT" in done.err
    assert list(latch.parent.iterdir()) == [latch]
    assert "CLIENT-ENTRY-LEFT" in done.err and "octoform clients remove cursor" in done.err
    live.run("clients", "remove", "cursor", status=0)
    assert all(path.read_text() == "mine\n" for path in mine)
    kept = {path.name for path in live.state.iterdir()}
    assert kept == {"state.json", "notes.md"}
    assert live.nodes() == {}
    assert not (live.local / "endpoint" / "launch").exists()
    assert not (live.local / "instances.json").exists()
    assert summary(live)["changes"]["add"] == 6
    assert "No changes" in live.run("plan", "-destroy", status=0).out
    assert "ENDPOINT-NOT-APPLIED" in live.run("tools", status=1).err


@pytest.mark.parametrize("command", [("plan",), ("status",), ("show",), ("validate",)])
def test_commands_before_the_first_apply_say_so_and_write_nothing(project: Project, command: tuple[str, ...]) -> None:
    before = sorted(project.folder.rglob("*"))
    done = project.run(*command)
    assert done.status == (6 if command == ("status",) else 0)  # nothing is known of its health
    assert done.out
    assert sorted(project.folder.rglob("*")) == before
