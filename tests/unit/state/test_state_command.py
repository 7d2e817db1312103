"""Octoform's git runs no program that a repository names, by whatever way it names it."""

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from octoform.engine.plan import memo
from octoform.state import git_access
from octoform.state.git_access import RepositoryRefused, call
from octoform.state.git_repository import commit, kept, repository_facts, versions

HOOKS = ["pre-commit", "prepare-commit-msg", "commit-msg", "post-commit", "post-index-change", "reference-transaction"]


class Planted:
    """A repository in which an agent left ``program``, which writes ``mark`` when anybody runs it."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.mark = root.parent / "ran"
        self.program = root.parent / "program"
        root.mkdir()
        self.program.write_text(f'#!/bin/sh\necho "$0 $*" >> {self.mark}\ncat\n')
        self.program.chmod(0o755)
        self.git("init", "-q", "-b", "main")
        self.git("config", "user.name", "Ada")
        self.git("config", "user.email", "ada@example.org")
        (root / "octopus.yaml").write_text("version: 1\n")
        (root / "state").mkdir()
        (root / "state" / "a").write_text("1\n")
        self.git("add", "-A")
        self.git("commit", "-qm", "first")

    def git(self, *words: str, folder: Path | None = None) -> str:
        done = subprocess.run(["git", *words], cwd=folder or self.root, check=True, capture_output=True, text=True)
        return done.stdout

    def set(self, key: str, folder: Path | None = None) -> None:
        self.git("config", key, str(self.program), folder=folder)

    def all_of_octoform(self) -> str | None:
        """Everything that octoform asks git; the revision of a commit of a new state."""
        paths = [self.root / "octopus.yaml", self.root / "state"]
        repository_facts(self.root, paths)
        kept(self.root, paths)
        list(versions(self.root, self.root / "state"))
        memo._dirty(self.root, {"sources": ["octopus.yaml", "state/a"]})
        (self.root / "state" / "a").write_text("another\n")
        (self.root / "state" / "b").write_text("new\n")
        revision, found = commit(self.root, [self.root / "state"], "m", {})
        assert found == []
        repository_facts(self.root, paths)
        return revision


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Planted:
    (tmp_path / "home").mkdir()
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    return Planted(tmp_path / "project")


def monitor(planted: Planted) -> None:
    planted.set("core.fsmonitor")


def hooks(planted: Planted) -> None:
    folder = planted.root / ".git" / "hooks"
    folder.mkdir(exist_ok=True)
    for name in HOOKS:
        (folder / name).write_bytes(planted.program.read_bytes())
        (folder / name).chmod(0o755)


def hooks_elsewhere(planted: Planted) -> None:
    hooks(planted)
    planted.git("config", "core.hooksPath", str(planted.root / ".git" / "hooks"))


def filters(planted: Planted) -> None:
    (planted.root / ".git" / "info" / "attributes").write_text("* filter=x\n")
    planted.set("filter.x.clean")
    planted.set("filter.x.smudge")
    planted.git("config", "filter.x.required", "true")


def filter_process(planted: Planted) -> None:
    (planted.root / "state" / ".gitattributes").write_text("* filter=a.b\n")
    planted.set("filter.a.b.process")


def diffs(planted: Planted) -> None:
    (planted.root / ".git" / "info" / "attributes").write_text("* diff=x\n")
    for key in ("diff.external", "diff.x.command", "diff.x.textconv"):
        planted.set(key)


def screens(planted: Planted) -> None:
    for key in ("core.pager", "core.editor", "sequence.editor", "pager.log", "core.askPass", "core.sshCommand"):
        planted.set(key)


def aliases(planted: Planted) -> None:
    for name in ("status", "log", "config", "rev-parse", "cat-file"):
        planted.git("config", f"alias.{name}", f"!{planted.program}")


def included(planted: Planted) -> None:
    other = planted.root.parent / "more.config"
    other.write_text(f'[core]\n\tfsmonitor = {planted.program}\n[filter "x"]\n\tclean = {planted.program}\n')
    (planted.root / ".git" / "info" / "attributes").write_text("* filter=x\n")
    planted.git("config", "include.path", str(other))


def of_the_worktree(planted: Planted) -> None:
    planted.git("config", "extensions.worktreeConfig", "true")
    (planted.root / ".git" / "info" / "attributes").write_text("* filter=x\n")
    planted.git("config", "--worktree", "filter.x.clean", str(planted.program))
    planted.git("config", "--worktree", "core.fsmonitor", str(planted.program))


def repository_within(planted: Planted) -> None:
    inner = planted.root / "state" / "inner"
    inner.mkdir()
    planted.git("init", "-q", folder=inner)
    (inner / "a").write_text("1\n")
    planted.git("add", "-A", folder=inner)
    planted.git("-c", "user.name=A", "-c", "user.email=a@b", "commit", "-qm", "inner", folder=inner)
    planted.git("add", "state")
    planted.git("commit", "-qm", "second")
    planted.set("core.fsmonitor", inner)
    (inner / "a").write_text("2\n")


WAYS = [
    monitor, hooks, hooks_elsewhere, filters, filter_process, diffs, screens, aliases, included, of_the_worktree,
    repository_within,
]  # fmt: skip


@pytest.mark.parametrize("way", WAYS, ids=lambda way: str(way.__name__))
def test_nothing_that_the_repository_names_is_run(planted: Planted, way: Callable[[Planted], None]) -> None:
    way(planted)
    planted.mark.unlink(missing_ok=True)
    revision = planted.all_of_octoform()
    assert not planted.mark.exists(), planted.mark.read_text()
    assert revision is not None
    done = call(str(planted.root), ["show", f"{revision}:state/a"])
    assert done.stdout == b"another\n", "what is committed is what is in the file"


def test_a_person_signs_with_their_own_program_and_never_with_the_repositorys(planted: Planted) -> None:
    theirs = planted.root.parent / "signer"
    theirs.write_text(
        "#!/bin/sh\ncat > /dev/null\necho '-----BEGIN PGP SIGNATURE-----'\necho '[GNUPG:] SIG_CREATED ' >&2\n"
        "echo signed\necho '-----END PGP SIGNATURE-----'\n"
    )
    theirs.chmod(0o755)
    planted.git("config", "--global", "gpg.program", str(theirs))
    planted.git("config", "--global", "commit.gpgSign", "true")
    planted.set("gpg.program")
    revision = planted.all_of_octoform()
    assert not planted.mark.exists()
    assert "PGP SIGNATURE" in planted.git("cat-file", "commit", revision or "")


def test_a_filter_of_the_persons_own_goes_on(planted: Planted) -> None:
    (planted.root / ".gitattributes").write_text("state/* filter=mine\n")
    planted.git("config", "--global", "filter.mine.clean", "tr a-z A-Z")
    revision = planted.all_of_octoform()
    assert call(str(planted.root), ["show", f"{revision}:state/a"]).stdout == b"ANOTHER\n"


def test_what_cannot_be_switched_off_is_told_and_git_is_not_used(planted: Planted) -> None:
    planted.set("filter.x=y.clean")
    with pytest.raises(RepositoryRefused, match=r"filter\.x=y\.clean"):
        call(str(planted.root), ["status"])
    facts, [problem] = repository_facts(planted.root, [planted.root / "octopus.yaml"])
    assert facts is None and problem.code == "GIT-UNUSABLE" and "x=y" in (problem.detail or "")


def test_a_folder_that_cannot_be_entered_is_never_exchanged_for_ours(
    planted: Planted, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(planted.root)
    with pytest.raises(RepositoryRefused, match="nowhere"):
        call(str(planted.root.parent / "nowhere"), ["rev-parse", "HEAD"])


def test_without_the_program_it_is_told_and_bytes_come_back_as_they_are(
    planted: Planted, monkeypatch: pytest.MonkeyPatch
) -> None:
    (planted.root / "state" / "a").write_bytes(b"\xff\0\n\n")
    revision, _ = commit(planted.root, [planted.root / "state"], "m", {})
    assert call(str(planted.root), ["cat-file", "blob", f"{revision}:state/a"]).stdout == b"\xff\0\n\n"
    monkeypatch.setenv("PATH", str(planted.root))
    with pytest.raises(FileNotFoundError, match="no git program"):
        call(str(planted.root), ["status"])


def test_a_call_that_does_not_end_is_ended(planted: Planted, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(git_access, "SECONDS", 0.3)
    slow = planted.root.parent / "bin" / "git"
    slow.parent.mkdir()
    slow.write_text('#!/bin/sh\ncase " $* " in *" config "*) exit 0;; esac\nexec sleep 600\n')
    slow.chmod(0o755)
    monkeypatch.setenv("PATH", f"{slow.parent}:{os.environ['PATH']}")
    done = call(str(planted.root), ["status"])
    assert done.returncode != 0 and b"did not complete in 0.3 secs" in done.stderr


def test_what_the_environment_says_of_another_repository_and_of_programs_is_not_taken(
    planted: Planted, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = planted.root.parent / "other"
    planted.git("init", "-q", str(other))
    for name, value in {"GIT_DIR": ".git", "GIT_WORK_TREE": ".", "GIT_INDEX_FILE": ".git/index"}.items():
        monkeypatch.setenv(name, str(other / value))
    for name in ("GIT_EXTERNAL_DIFF", "GIT_PAGER", "GIT_ASKPASS", "GIT_SSH", "GIT_SEQUENCE_EDITOR", "GIT_EDITOR"):
        monkeypatch.setenv(name, str(planted.program))
    for name, value in {"COUNT": "1", "KEY_0": "core.fsmonitor", "VALUE_0": str(planted.program)}.items():
        monkeypatch.setenv(f"GIT_CONFIG_{name}", value)
    (planted.root / "octopus.yaml").write_text("version: 2\n")
    assert memo._dirty(planted.root, {"sources": ["octopus.yaml", "state/a"]}) == ("octopus.yaml",)
    assert planted.all_of_octoform() is not None
    assert not planted.mark.exists()


def test_an_object_that_was_replaced_is_read_as_it_was_committed(planted: Planted) -> None:
    former = planted.git("rev-parse", "HEAD:state/a").strip()
    (planted.root / "state" / "a").write_text("planted\n")
    planted.git("replace", former, planted.git("hash-object", "-w", "state/a").strip())
    [files] = versions(planted.root, planted.root / "state")
    assert files == {"a": b"1\n"}
