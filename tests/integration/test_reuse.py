"""One agent run for many equal hosts: what was accepted for one is verified for the next and taken over."""

import json
import os
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project

from octoform.state.accepted import file_digest
from octoform.state.layout import Layout
from octoform.state.reusable import find

pytestmark = pytest.mark.dear


def repository(folder: Path) -> Project:
    """A project at the top of a git repository."""
    made = Project(folder / "project", folder / "outside")
    made.write()
    git(made.folder, "init", "--quiet", "--template=")
    return made


def git(folder: Path, *arguments: str) -> None:
    subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True)


@pytest.fixture(scope="module")
def accepted(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, Path, Path]:
    """A host whose stages are accepted up to INTERFACE, and copies of its folder: without and with another host."""
    folder = tmp_path_factory.mktemp("lender")
    made = repository(folder)
    made.apply("-target", "interface", status=0)
    shutil.copytree(made.folder, folder / "copy", symlinks=True)
    beside(made, "bench-2").apply("-target", "probe", status=0)
    shutil.copytree(made.folder, folder / "probed", symlinks=True)
    return made, folder / "copy", folder / "probed"


@pytest.fixture
def lender(accepted: tuple[Project, Path, Path], request: pytest.FixtureRequest) -> Project:
    """That host as it was, at its own place, whatever the test before has done there."""
    project, copy, with_another = accepted
    shutil.rmtree(project.folder)
    shutil.copytree(with_another if "probed" in request.fixturenames else copy, project.folder, symlinks=True)
    return project


@pytest.fixture
def probed(lender: Project) -> Project:
    """The host `bench-2` beside it, of which PROBE is accepted."""
    return beside(lender, "bench-2")


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
    number = int(other.attempts("identify")[0].name.partition("-")[0])
    shown = other.run("attempts", "show", str(number), status=0).out
    assert "reused     the accepted output of host bench; no agent ran" in shown
    assert not any(name in shown for name in ("prompt.md", "agent.log", "transcript.jsonl", "try 0"))
    document = json.loads(other.run("attempts", "-json", "show", str(number), status=0).out)
    assert (document["prompt"], document["log"]) == (None, None)
    found = other.run("state", "show", "identify", status=0).out
    assert f"from host bench of project ../.. (serial {made['serial']}), accepted there at 2" in found
    assert "; made for host bench\n" in found and "0 attempts" not in found
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
    assert "reused from host bench, verified here; no agent runs" in text
    assert "Agent runs: none; all is reused." in text


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


def false_but_vouched_for(lender: Project, quote: str = "a quote that PROBE never saw") -> None:
    """An artifact that breaks the contract, with a state in which it was accepted as it is."""
    path = lender.state / "identify" / "output.json"
    value = json.loads(path.read_text())
    value["devices"][0]["evidence"][0]["quote"] = quote
    path.write_text(json.dumps(value))
    state = json.loads((lender.state / "state.json").read_text())
    state["nodes"]["identify"]["file_digest"] = file_digest(Layout(lender.folder, lender.host), "identify")
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


def nested(lender: Project) -> None:
    """Everything lies in a repository of its own below this one: a clone, a submodule."""
    git(moved(lender), "init", "--quiet")


def worktree(lender: Project) -> None:
    """The top is a file that points to the repository, as in a submodule or a worktree."""
    (moved(lender) / ".git").write_text(f"gitdir: {lender.folder / '.git' / 'modules' / 'foreign'}\n")


def nested_but_tracked(lender: Project) -> None:
    """Files that this repository knew before another one was made around them."""
    git(lender.folder, "add", str(moved(lender)))
    git(lender.folder / "foreign", "init", "--quiet")


def a_repository_for_one_host(lender: Project) -> None:
    git(lender.folder, "add", "state")
    git(lender.state, "init", "--quiet")


def ignored(lender: Project) -> None:
    (lender.folder / ".gitignore").write_text("/state/\n")


def ignored_state(lender: Project) -> None:
    (lender.folder / ".gitignore").write_text("state.json\n")


def ignored_artifact(lender: Project) -> None:
    (lender.folder / ".gitignore").write_text("output.json\n")


def corrected_spec(lender: Project) -> None:
    """The agent corrected its spec, and that is not promoted."""
    path = lender.state / "state.json"
    state = json.loads(path.read_text())
    state["nodes"]["identify"]["detail"]["spec_edit"] = {"digest": "sha256:1", "base": "sha256:2"}
    path.write_text(json.dumps(state))


def moved(lender: Project) -> Path:
    """Move the lender's state into a folder below, where it would be found as well."""
    folder = lender.folder / "foreign"
    folder.mkdir()
    shutil.move(lender.folder / "state", folder / "state")
    return folder


@pytest.mark.parametrize(
    "spoil",
    [
        nested,
        worktree,
        nested_but_tracked,
        a_repository_for_one_host,
        ignored,
        ignored_state,
        ignored_artifact,
        corrected_spec,
    ],
)
def test_what_is_not_equal_or_not_of_this_repository_is_never_offered(
    lender: Project, probed: Project, spoil: Any
) -> None:
    spoil(lender)
    change = planned(probed, "-target", "identify")["identify"]
    assert ("loan" in change, change["calls_agent"]) == (False, True)
    if spoil not in (nested, ignored, corrected_spec):  # one of each kind: an apply looks as a plan does
        return
    before = len(lender.agent_runs())
    done = probed.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["identify"]
    assert "host bench " not in notices(done), "nobody looked at it"


def test_a_folder_that_was_only_moved_lends_and_so_does_a_tracked_one_that_is_ignored(lender: Project) -> None:
    git(lender.folder, "add", str(moved(lender)))
    (lender.folder / ".gitignore").write_text("state/\n")
    other = beside(lender, "bench-2")
    other.apply("-target", "identify", status=0)
    assert other.nodes()["identify"]["detail"]["reused"]["project"] == "../../foreign"


def test_outside_a_repository_the_projects_own_hosts_lend(lender: Project) -> None:
    shutil.rmtree(lender.folder / ".git")
    other = replace(lender, host="bench-2")
    assert planned(other, "-target", "identify")["identify"]["loan"]["host"] == "bench"
    moved(lender)
    assert "loan" not in planned(other, "-target", "identify")["identify"], "nor do those in a folder below"


def test_what_was_never_promoted_is_lent_once_it_is(lender: Project) -> None:
    line = "Every quote is in quotation marks."
    lender.script = {"identify": [{"write": "no json"}, {"edit_spec": line}]}
    lender.apply("-target", "identify", "-replace", "identify", status=0)
    lender.script = {}
    other = replace(lender, host="bench-2")
    other.apply("-target", "probe", status=0)
    assert "loan" not in planned(other, "-target", "identify")["identify"]
    lender.write()
    lender.run("spec", "promote", "identify", status=0)
    assert planned(other, "-target", "identify")["identify"]["loan"]["host"] == "bench"


def test_a_host_does_not_lend_to_itself_through_a_link(lender: Project, tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(lender.folder)
    assert [key for keys in find(Layout(tmp_path / "link", "bench")).values() for key in keys] == []
    assert [key for keys in find(Layout(tmp_path / "link", "bench-2")).values() for key in keys] != []


def test_a_plan_with_nothing_to_do_looks_at_no_other_host(
    lender: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A git that records its calls is first on the path."""
    other = beside(lender, "bench-2")
    other.apply("-target", "identify", status=0)
    log, program = tmp_path / "log", tmp_path / "git"
    program.write_text(f'#!/bin/sh\necho "$@" >> {log}\nexec {shutil.which("git")} "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    assert planned(other, "-target", "identify") == {}
    assert "ls-files" not in (log.read_text() if log.exists() else "")
    planned(other, "-target", "interface")
    assert log.read_text().count("ls-files") == 1, "one question for all hosts"


def lenders(lender: Project, *names: str) -> list[Project]:
    """More hosts with the same accepted outputs."""
    made = [beside(lender, name) for name in names]
    for one in made:
        one.apply("-target", "identify", status=0)
    return made


def test_behind_one_that_is_damaged_the_next_is_tried(lender: Project) -> None:
    [second] = lenders(lender, "a-2")
    edited(second)
    other = beside(lender, "bench-3")
    before = len(lender.agent_runs())
    done = other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe"]
    assert other.nodes()["identify"]["detail"]["reused"]["host"] == "bench"
    assert notices(done).count("host a-2") == 1
    assert other.attempts("identify")[0].name.endswith("identify-0")


def test_behind_one_that_does_not_hold_the_next_is_tried_and_each_is_told_once(lender: Project) -> None:
    """Two that break the contract, each in its own way, a copy of the first, and one that is sound."""
    first, copy, second = lenders(lender, "a-1", "a-2", "a-3")
    for one, quote in ((first, "never seen"), (copy, "never seen"), (second, "nor this")):
        false_but_vouched_for(one, quote)
    other = beside(lender, "b-1")
    before = len(lender.agent_runs())
    done = other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe"]
    assert other.nodes()["identify"]["detail"]["reused"]["host"] == "bench"
    lines = [event["text"] for event in done.events() if "does not hold here" in str(event.get("text"))]
    assert [text.split()[4] for text in lines] == ["a-1", "a-3"]
    listed = other.run("attempts", "-stage", "identify", status=0).out
    assert listed.count("refused IDENTIFY-") == 2, "a refused output is not called reused"


def test_behind_five_that_do_not_hold_the_agent_is_asked(lender: Project) -> None:
    """The sixth would hold; copies of state folders stand for hosts of their own."""
    for number in range(5):
        name = f"a-{number}"
        shutil.copytree(lender.state, lender.folder / "state" / name)
        path = lender.folder / "state" / name / "state.json"
        path.write_text(path.read_text().replace('"host": "bench"', f'"host": "{name}"'))
        edited(replace(lender, host=name))
    other = beside(lender, "b-1")
    before = len(lender.agent_runs())
    done = other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe", "identify"]
    assert notices(done).count("not reused") == 5


def test_another_spec_harness_or_model_is_another_key(lender: Project) -> None:
    other = beside(lender, "bench-2")
    other.write()
    with (other.own_specs() / "identify.md").open("a") as spec:
        spec.write("One more sentence.\n")
    before = len(lender.agent_runs())
    other.apply("-target", "identify", status=0)
    assert lender.stages_run()[before:] == ["probe", "identify"]


def test_a_live_endpoint_from_another_hosts_stages(lender: Project, environments: Path) -> None:
    lender.share_environments(environments)
    lender.apply("-target", "deploy", status=0)
    before = len(lender.agent_runs())
    other = beside(lender, "bench-2")
    other.share_environments(environments)
    done = other.apply(status=0)
    assert lender.stages_run()[before:] == ["probe"]
    # The list that a real client got at the end of the apply.
    assert done.events()[-1]["result"]["endpoint"]["tools"] == ["read_temperature"]
    for stage, name in (("serve", "server.py"), ("deploy", "output.json"), ("deploy", "requirements.txt")):
        assert (other.state / stage / name).read_bytes() == (lender.state / stage / name).read_bytes()
