"""State in git: who made what is in the commit, a person's work is left alone, a folder without git is the same.

Also two hosts of one repository, each with its own state and its own lock.
"""

import json
import subprocess
from pathlib import Path

from projects import Project


def git(project: Project, *arguments: str) -> str:
    """The output of git in the project's folder; it must succeed."""
    done = subprocess.run(["git", *arguments], cwd=project.folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def repository(project: Project) -> Project:
    """Make the project a git repository with one commit, whose applies commit."""
    git(project, "init", "--quiet", "--initial-branch=main")
    git(project, "config", "user.name", "A Person")
    git(project, "config", "user.email", "person@example.org")
    project.manifest = {"git": "{commit: true}"}
    project.write()
    git(project, "add", "octopus.yaml")
    git(project, "commit", "--quiet", "-m", "A bench")
    return project


def test_an_apply_commits_what_it_changed_and_says_what_made_it(project: Project) -> None:
    repository(project)
    (project.folder / "notes.md").write_text("staged by a person\n")
    git(project, "add", "notes.md")
    done = project.apply("-target", "identify", status=0)
    made = json.loads(done.out.splitlines()[-1])["result"]["commit"]
    assert git(project, "rev-parse", "HEAD").strip() == made
    message = git(project, "log", "-1", "--format=%B")
    snapshot = json.loads((project.state / "state.json").read_text())
    assert message.startswith("octoform apply bench: serial 1\n")
    for line in (
        "Octoform-Host: bench",
        f"Octoform-Lineage: {snapshot['lineage']}",
        "Octoform-Serial: 1",
        "Octoform-Harness: command",
        "Octoform-Model: none",
        "Octoform-Usage: tokens unknown, cost unknown",
    ):
        assert line in message
    assert git(project, "log", "-1", "--format=%an").strip() == "A Person"
    changed = git(project, "show", "--name-only", "--format=", "HEAD").split()
    assert changed == [f"state/bench/{name}" for name in ("identify/output.json", "probe/output.json", "state.json")]
    assert git(project, "status", "--porcelain").splitlines() == ["A  notes.md"]


def test_nothing_to_do_is_no_commit(project: Project) -> None:
    repository(project)
    project.apply("-target", "probe", status=0)
    before = git(project, "rev-parse", "HEAD")
    project.apply("-target", "probe", status=0)
    assert git(project, "rev-parse", "HEAD") == before


def test_a_commit_that_git_refuses_is_told_and_the_state_stays(project: Project) -> None:
    repository(project)
    before = git(project, "rev-parse", "HEAD")
    branch = git(project, "symbolic-ref", "HEAD").strip()
    lock = project.folder / ".git" / f"{branch}.lock"
    lock.touch()
    done = project.run("apply", "-auto-approve", "-target", "probe")
    assert "GIT-COMMIT-FAILED" in done.err
    assert lock.name in done.err
    assert done.status == 1
    lock.unlink()
    assert git(project, "rev-parse", "HEAD") == before
    assert project.nodes()["probe"]["status"] == "accepted"
    assert git(project, "diff", "--cached", "--name-only") == ""
    assert "No changes" in project.run("plan", "-target", "probe", status=0).out


def test_the_plan_names_the_revision_and_what_is_not_committed(project: Project) -> None:
    repository(project)
    specs = project.own_specs()
    git(project, "add", "protocol")
    git(project, "commit", "--quiet", "-m", "Specs")
    revision = git(project, "rev-parse", "HEAD").strip()
    assert f"revision {revision[:12]}\n" in project.run("plan", "-target", "probe", status=0).out
    (specs / "probe.md").write_text((specs / "probe.md").read_text() + "\nBe brief.\n")
    (project.folder / "unrelated.txt").write_text("not read by octoform\n")
    shown = project.run("plan", "-target", "probe", status=0).out
    assert f"revision {revision[:12]} with uncommitted protocol/probe.md" in shown
    project.apply("-target", "probe", status=0)
    record = json.loads((project.state / "state.json").read_text())["git"]
    assert record == {"revision": revision, "dirty": ["protocol/probe.md"]}


def test_outside_a_repository_everything_is_the_same_but_the_commit(project: Project) -> None:
    project.manifest = {"git": "{commit: true}"}
    done = project.apply("-target", "probe", status=0)
    assert json.loads(done.out.splitlines()[-1])["result"]["commit"] is None
    assert json.loads((project.state / "state.json").read_text())["git"] is None
    assert "revision" not in project.run("plan", "-target", "probe", status=0).out


def test_two_hosts_of_one_folder_have_a_state_and_a_lock_each(project: Project) -> None:
    project.apply("-target", "probe", status=0)
    first = (project.state / "state.json").read_bytes()
    manifest = project.folder / "octopus.yaml"
    text = manifest.read_text()

    project.script = {"probe": [{"sleep": 60}]}
    project.write()
    running = project.start("apply", "-auto-approve", "-target", "probe", "-replace", "probe")
    project.wait_for_agent(2)
    project.script = {}
    project.write()
    manifest.write_text(text.replace("host: bench", "host: attic"))
    project.run("apply", "-auto-approve", "-target", "identify", status=0)
    attic = json.loads((project.folder / "state" / "attic" / "state.json").read_text())
    assert set(attic["nodes"]) == {"probe", "identify"}
    assert attic["lineage"] != json.loads(first)["lineage"]
    assert (project.state / "state.json").read_bytes() == first
    project.run("destroy", "-auto-approve", status=0)
    manifest.write_text(text)
    assert (project.state / "probe" / "output.json").exists()
    running.terminate()
    running.communicate(timeout=30)


def test_init_gives_a_manifest_that_validates_and_is_never_written_twice(tmp_path: Path) -> None:
    made = Project(tmp_path / "new", tmp_path / "outside")
    made.folder.mkdir()
    made.run("init", "-host", "bench", status=0)
    text = (made.folder / "octopus.yaml").read_text()
    assert "host: bench" in text
    made.run("validate", status=0)
    assert "6 to add" in made.run("plan", status=0).out
    assert "MANIFEST-EXISTS" in made.run("init", status=1).err
    assert (made.folder / "octopus.yaml").read_text() == text
    assert json.loads(made.run("schema", status=0).out)["properties"].keys() >= {"version", "host", "harness"}
