"""Hybrid: the embedded agent writes what it is certain of, and only what it left unknown is asked of another agent."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from projects import Project

Planted = Callable[..., Path]


@pytest.fixture
def hybrid(project: Project, planted: Planted) -> Project:
    """A bench with serial boards that the embedded agent cannot name; the scripted agent is the one to ask."""
    on_host(project, planted("bench"))
    project.script = {"identify": [{"name_all": "Heron bench"}]}
    return project


def on_host(project: Project, root: Path) -> None:
    """Point the project at a planted host, with the scripted agent only behind the embedded one."""
    project.environ["OCTOFORM_SYSROOT"] = str(root)
    project.harness = "builtin"
    project.manifest = {"stages": f"{{identify: {{escalate: {{harness: {project.scripted()}}}}}}}"}


def identified(project: Project) -> dict[str, Any]:
    value: dict[str, Any] = json.loads((project.state / "identify" / "output.json").read_text())
    return value


def test_only_the_unknown_is_asked_and_the_answer_joins_the_rest(hybrid: Project, planted: Planted) -> None:
    done = hybrid.apply("-target", "identify", status=0)
    asked = json.loads((hybrid.attempts("identify")[1] / "input.json").read_text())["devices"]
    value = identified(hybrid)
    named = [device["id"] for device in value["devices"] if device["identified_as"] == "Heron bench"]
    assert named == [device["id"] for device in asked] != []
    assert len(value["devices"]) > len(named), "what the embedded agent knew stays in its words"
    assert [run["stage"] for run in hybrid.agent_runs()] == ["identify"]
    node = hybrid.nodes()["identify"]
    assert node["detail"]["escalated"]["asked"] == len(asked)
    assert node["detail"]["escalated"]["still_unknown"] == 0
    assert node["attempts"] == 2
    assert done.events()[-1]["result"]["agent_runs"] == 3
    found = hybrid.run("state", "show", "identify", status=0).out
    assert f"escalated command was asked about {len(asked)} unknown; 0 still unknown" in found


def test_a_host_where_nothing_is_unknown_asks_nobody(hybrid: Project, planted: Planted) -> None:
    on_known = planted("empty-vm")
    hybrid.environ["OCTOFORM_SYSROOT"] = str(on_known)
    hybrid.apply("-target", "identify", status=0)
    assert hybrid.agent_runs() == []
    assert "escalated" not in hybrid.nodes()["identify"]["detail"]


def test_an_answer_about_something_else_is_refused(hybrid: Project) -> None:
    """The second agent names a device that the first was certain of; its contract knows only what it was given."""
    hybrid.apply("-target", "identify", status=0)
    known = next(item for item in identified(hybrid)["devices"] if item["identified_as"] != "Heron bench")
    wrong = json.dumps({"format": 1, "devices": [{**known, "identified_as": "something else"}], "left_out": []})
    hybrid.script = {"identify": [{"write": wrong}, {"name_all": "Heron bench"}]}
    done = hybrid.apply("-target", "identify", "-replace", "identify", status=0)
    assert "IDENTIFY-INVENTED-DEVICE" in done.codes()
    assert known in identified(hybrid)["devices"]


def test_an_escalation_that_fails_fails_the_stage(hybrid: Project) -> None:
    hybrid.script = {"identify": [{"write": "no json"}]}
    done = hybrid.apply("-target", "identify", status=1)
    assert done.events()[-1]["result"]["failed"] == "identify"
    assert not (hybrid.state / "identify" / "output.json").exists()


def test_the_plan_says_that_a_model_may_be_called(hybrid: Project) -> None:
    hybrid.write()
    events = hybrid.run("plan", "-json", status=0).events()
    calls = {event["change"]["node"]: event["change"]["calls_model"] for event in events if "change" in event}
    assert calls["identify"] is True
    assert calls["probe"] is False


def test_the_plan_and_a_saved_one_say_who_is_asked_for_the_unknown(hybrid: Project) -> None:
    hybrid.write()
    text = hybrid.run("plan", "-target", "identify", "-out", "saved.plan", status=0).out
    for shown in (text, hybrid.run("show", "saved.plan", status=0).out):
        assert "probe      will be created  [builtin]" in shown
        assert "identify   will be created  [builtin, then command]" in shown


def test_whom_to_ask_is_ignored_where_makers_are(hybrid: Project) -> None:
    hybrid.apply("-target", "identify", status=0)
    hybrid.manifest["lifecycle"] = "{ignore: [harness, model]}"
    hybrid.manifest["stages"] = hybrid.manifest["stages"].replace("agent.py", "./agent.py")
    hybrid.write()
    assert hybrid.run("plan", "-target", "identify", "-detailed-exitcode").status == 0


def test_another_agent_to_ask_is_another_key(hybrid: Project) -> None:
    hybrid.apply("-target", "identify", status=0)
    before = len(hybrid.agent_runs())
    hybrid.manifest = {}
    hybrid.apply("-target", "identify", status=0)
    assert any(device["category"] == "unknown" for device in identified(hybrid)["devices"])
    assert len(hybrid.agent_runs()) == before
