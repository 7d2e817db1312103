"""One agent run for many equal hosts: what was accepted for one is verified for the next and taken over."""

import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project


def repository(folder: Path) -> Project:
    """A project at the top of a git repository."""
    made = Project(folder / "project", folder / "outside")
    made.write()
    subprocess.run(["git", "init", "--quiet"], cwd=made.folder, check=True)
    return made


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, Path]:
    """A host whose stages are accepted up to INTERFACE, and a copy of its folder as it was then."""
    folder = tmp_path_factory.mktemp("lender")
    made = repository(folder)
    made.apply("-target", "interface", status=0)
    shutil.copytree(made.folder, folder / "copy", symlinks=True)
    return made, folder / "copy"


@pytest.fixture
def lender(accepted: tuple[Project, Path]) -> Project:
    """That host as it was, at its own place, whatever the test before has done there."""
    project, copy = accepted
    shutil.rmtree(project.folder)
    shutil.copytree(copy, project.folder, symlinks=True)
    return project


def beside(lender: Project, name: str) -> Project:
    """Another host in the same repository, with the same agent and script."""
    return replace(lender, folder=lender.folder / "hosts" / name, host=name)


def planned(project: Project, *arguments: str) -> dict[str, dict[str, Any]]:
    project.write()
    events = project.run("plan", "-json", *arguments, status=0).events()
    return {event["change"]["node"]: event["change"] for event in events if event["type"] == "planned_change"}


def notices(done: Done) -> str:
    return "\n".join(str(event.get("text", "")) for event in done.events())


def test_only_probe_runs_on_the_next_host_and_the_state_says_where_the_rest_is_from(lender: Project) -> None:
    before = len(lender.agent_runs())
    other = beside(lender, "bench-2")
    done = other.apply("-target", "interface", status=0)
    assert lender.stages_run()[before:] == ["probe"]
    nodes = other.nodes()
    made = nodes["identify"]["detail"]["reused"]
    assert (made["host"], made["project"], made["made_for"]) == ("bench", "../..", "bench")
    assert (nodes["identify"]["attempts"], nodes["identify"]["harness"]) == (0, "command")
    assert nodes["identify"]["key"] == lender.nodes()["identify"]["key"]
    for stage in ("identify", "interface"):
        assert (other.state / stage / "output.json").read_bytes() == (lender.state / stage / "output.json").read_bytes()
    assert done.events()[-1]["result"]["agent_runs"] == 1
    assert planned(other, "-target", "interface") == {}


def test_a_third_host_learns_from_the_second_who_made_it(lender: Project) -> None:
    beside(lender, "bench-2").apply("-target", "identify", status=0)
    shutil.rmtree(lender.state)
    third = beside(lender, "bench-3")
    third.apply("-target", "identify", status=0)
    made = third.nodes()["identify"]["detail"]["reused"]
    assert (made["host"], made["made_for"]) == ("bench-2", "bench")


def test_the_plan_tells_beforehand(lender: Project) -> None:
    other = beside(lender, "bench-2")
    first = planned(other, "-target", "interface")
    assert first["identify"]["loan"]["host"] == "bench"
    assert first["identify"]["loan"]["certain"] is False, "PROBE has not run yet"
    other.apply("-target", "probe", status=0)
    then = planned(other, "-target", "interface")
    assert [then[node]["loan"]["certain"] for node in ("identify", "interface")] == [True, True]
    assert [then[node]["calls_agent"] for node in ("identify", "interface")] == [False, False]
    text = other.run("plan", "-target", "interface", status=0).out
    assert "taken over from host bench, verified here; no agent runs" in text
    assert "Agent runs: none; all is taken over." in text


def test_no_reuse_runs_every_agent(lender: Project) -> None:
    before = len(lender.agent_runs())
    other = beside(lender, "bench-2")
    assert "loan" not in planned(other, "-target", "identify", "-no-reuse")["identify"]
    other.apply("-target", "identify", "-no-reuse", status=0)
    assert lender.stages_run()[before:] == ["probe", "identify"]
    assert "reused" not in other.nodes()["identify"]["detail"]


def test_what_is_asked_for_anew_is_made_anew(lender: Project) -> None:
    other = beside(lender, "bench-2")
    other.apply("-target", "identify", status=0)
    before = len(lender.agent_runs())
    other.apply("-target", "identify", "-replace", "identify", status=0)
    assert lender.stages_run()[before:] == ["identify"]


def edited(lender: Project) -> None:
    """Somebody changed the other host's artifact by hand."""
    path = lender.state / "identify" / "output.json"
    path.write_text(path.read_text().replace("benchtemp board temperature sensor", "a lamp"))


def other_kinds(lender: Project) -> None:
    """The other host's PROBE gave something else, so its key is another one."""
    path = lender.state / "state.json"
    state = json.loads(path.read_text())
    state["nodes"]["identify"]["key"] = "sha256:" + "0" * 64
    path.write_text(json.dumps(state))


def unreadable(lender: Project) -> None:
    (lender.state / "state.json").write_text("{")


def false_but_vouched_for(lender: Project) -> None:
    """An artifact that breaks the contract, with a state that says that it was accepted as it is."""
    from octoform.state.artifacts import file_digest
    from octoform.state.layout import Layout

    path = lender.state / "identify" / "output.json"
    value = json.loads(path.read_text())
    value["devices"][0]["evidence"][0]["quote"] = "a quote that PROBE never saw"
    path.write_text(json.dumps(value))
    state = json.loads((lender.state / "state.json").read_text())
    state["nodes"]["identify"]["file_digest"] = file_digest(Layout(lender.folder, "bench"), "identify")
    (lender.state / "state.json").write_text(json.dumps(state))


@pytest.mark.parametrize("spoil", [edited, other_kinds, unreadable, false_but_vouched_for])
def test_what_does_not_hold_here_is_not_taken_over(lender: Project, spoil: Any) -> None:
    spoil(lender)
    before = len(lender.agent_runs())
    other = beside(lender, "bench-2")
    done = other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe", "identify"]
    if spoil in (edited, false_but_vouched_for):
        assert "host bench" in notices(done), "the reason is told"


def test_another_spec_harness_or_model_is_another_key(lender: Project) -> None:
    other = beside(lender, "bench-2")
    other.write()
    with (other.own_specs() / "identify.md").open("a") as spec:
        spec.write("One more sentence.\n")
    before = len(lender.agent_runs())
    other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe", "identify"]


def test_a_live_endpoint_from_another_hosts_stages(lender: Project) -> None:
    lender.apply(status=0)
    before = len(lender.agent_runs())
    other = beside(lender, "bench-2")
    other.share_environments(lender.local / "environments")
    done = other.apply(status=0)
    assert lender.stages_run()[before:] == ["probe"]
    # What a real client was told at the end of the apply.
    assert done.events()[-1]["result"]["endpoint"]["tools"] == ["read_temperature"]
    for stage, name in (("serve", "server.py"), ("deploy", "output.json"), ("deploy", "requirements.txt")):
        assert (other.state / stage / name).read_bytes() == (lender.state / stage / name).read_bytes()
