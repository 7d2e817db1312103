"""Git never takes what is private: the rule that keeps it out is held, whatever became of its file."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.cli.dispatch import dispatch
from octoform.state.files import hide_from_git, make_folders
from octoform.state.layout import Layout


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def edited(path: Path) -> None:
    path.write_bytes(b"*\n!bench/\n")


def deleted(path: Path) -> None:
    path.unlink()


def closed(path: Path) -> None:
    path.write_bytes(b"")
    path.chmod(0)


def link(path: Path) -> None:
    path.unlink()
    other = path.parents[1] / "other"
    other.write_bytes(b"mine\n")
    path.symlink_to(other)


def lost_link(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()
    (path / "kept").write_text("something\n")


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


DAMAGES = [emptied, edited, deleted, closed, link, lost_link, folder, pipe]
WRITING = [
    ["apply"], ["start"], ["stop"], ["tools"], ["call", "x"], ["estop"], ["token", "list"], ["pause"], ["init"],
    ["claims"], ["claims", "-retire", "x"], ["confirm", "x"], ["restart"], ["resume"], ["revoke"], ["heal"],
    ["connect", "bench"], ["clients", "list"], ["state", "adopt", "probe"], ["answer", "x", "y"], ["destroy"], ["look"],
    ["audit"], ["force-unlock", "x"], ["limits"], ["service", "install"], ["spec", "diff"], ["state", "list"],
    ["watch", "-once"],
]  # fmt: skip


@pytest.fixture
def project(tmp_path: Path) -> Path:
    made = tmp_path / "project"
    assert make_folders(Layout(made, "bench")) is None
    (made / ".octoform" / "bench" / "instances.json").write_text('{"serial": "1"}')
    return made


def staged(project: Path) -> str:
    subprocess.run(["git", "init", "-q", str(project)], check=True)
    subprocess.run(["git", "-C", str(project), "add", "-A"], check=True)
    done = subprocess.run(
        ["git", "-C", str(project), "ls-files", "*octoform*"], check=True, capture_output=True, text=True
    )
    return done.stdout


@pytest.mark.parametrize("damage", DAMAGES, ids=lambda damage: str(damage.__name__))
def test_a_damaged_rule_is_written_again_and_git_takes_nothing(project: Path, damage: Callable[[Path], None]) -> None:
    damage(project / ".octoform" / ".gitignore")
    assert make_folders(Layout(project, "bench")) is None
    assert staged(project) == ""


def of_other_hosts(project: Path) -> None:
    """A second host, whose folder speaks for itself."""
    assert make_folders(Layout(project, "other")) is None
    (project / ".octoform" / "other" / "instances.json").write_text('{"serial": "2"}')
    (project / ".octoform" / "other" / ".gitignore").write_text("!*\n!instances.json\n")


def above(project: Path) -> None:
    (project / ".gitignore").write_text("!.octoform\n!.octoform/**\n!**/instances.json\n")


def further_above(project: Path) -> None:
    """The repository begins above the project."""
    (project.parent / ".gitignore").write_text("!.octoform\n!**/.octoform/**\n")
    subprocess.run(["git", "init", "-q", str(project.parent)], check=True)


def of_the_repository(project: Path) -> None:
    subprocess.run(["git", "init", "-q", str(project)], check=True)
    (project / ".git" / "info" / "exclude").write_text("!.octoform/**\n!instances.json\n")
    (project / "excludes").write_text("!.octoform/**\n")
    words = ["config", "core.excludesFile", str(project / "excludes")]
    subprocess.run(["git", "-C", str(project), *words], check=True)


@pytest.mark.parametrize(
    "rule", [of_other_hosts, above, further_above, of_the_repository], ids=lambda rule: str(rule.__name__)
)
def test_no_other_rule_brings_it_back(project: Path, rule: Callable[[Path], None]) -> None:
    emptied(project / ".octoform" / ".gitignore")
    rule(project)
    assert hide_from_git(project) is None
    assert staged(project.parent if (project.parent / ".git").exists() else project) == ""


def test_what_stood_in_its_place_is_not_lost(project: Path) -> None:
    rule = project / ".octoform" / ".gitignore"
    link(rule)
    hide_from_git(project)
    assert (project / "other").read_bytes() == b"mine\n"
    folder(rule)
    hide_from_git(project)
    assert [path.read_text() for path in rule.parent.glob(".gitignore.*/kept")] == ["something\n"]


@pytest.mark.parametrize("words", WRITING, ids=" ".join)
def test_every_command_that_writes_holds_it_also_one_that_fails(project: Path, words: list[str]) -> None:
    rule = project / ".octoform" / ".gitignore"
    rule.write_bytes(b"")
    dispatch([f"-chdir={project}", *words])
    assert rule.read_bytes() == b"*\n"


def test_a_plan_writes_nothing_and_no_folder_is_made_for_it(project: Path, tmp_path: Path) -> None:
    rule = project / ".octoform" / ".gitignore"
    rule.write_bytes(b"")
    dispatch([f"-chdir={project}", "plan"])
    assert rule.read_bytes() == b""
    assert hide_from_git(tmp_path) is None
    assert not (tmp_path / ".octoform").exists()
