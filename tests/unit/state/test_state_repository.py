"""Git, with real repositories: what is dirty, and commits that touch nothing of the person's."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from octoform.state import git_access
from octoform.state.git_access import head_revision
from octoform.state.git_repository import commit, kept, repository_facts, versions

TRAILERS = {"Octoform-Host": "bench", "Octoform-Serial": "3"}


class Project:
    """A project folder in a repository, and the git program to look at it with."""

    def __init__(self, root: Path) -> None:
        self.root = root
        root.mkdir(parents=True, exist_ok=True)

    def git(self, *arguments: str) -> str:
        run = subprocess.run(["git", *arguments], cwd=self.root, capture_output=True, text=True, check=True)
        return run.stdout.strip()

    def write(self, name: str, text: str = "x") -> Path:
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def commit_all(self) -> str:
        self.git("add", "-A")
        self.git("commit", "-q", "-m", "by hand")
        return self.git("rev-parse", "HEAD")

    def last_files(self) -> list[str]:
        return self.git("show", "--name-only", "--format=", "HEAD").splitlines()


@pytest.fixture(autouse=True)
def nobody_s_settings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No setting of the machine or its user reaches git here."""
    for name in [name for name in os.environ if name.startswith("GIT_") or name == "EMAIL"]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")


@pytest.fixture
def repo(tmp_path: Path) -> Project:
    project = Project(tmp_path / "repo")
    project.git("init", "-q", "-b", "main")
    project.git("config", "user.name", "Ada")
    project.git("config", "user.email", "ada@example.org")
    return project


def committed(project: Project, *names: str) -> str:
    revision, found = commit(project.root, [project.root / name for name in names or ("state",)], "octoform", TRAILERS)
    assert found == [] and revision is not None
    assert revision == project.git("rev-parse", "HEAD") == head_revision(project.root)
    return revision


def test_outside_a_repository_there_is_nothing_to_say(tmp_path: Path) -> None:
    assert repository_facts(tmp_path, [tmp_path / "octopus.yaml"]) == (None, [])
    assert commit(tmp_path, [tmp_path], "m", {}) == (None, [])
    assert head_revision(tmp_path) is None


def test_before_the_first_commit(repo: Project) -> None:
    path = repo.write("octopus.yaml")
    facts, found = repository_facts(repo.root, [path])
    assert found == [] and facts is not None
    assert (facts.revision, facts.dirty, facts.branch) == (None, ("octopus.yaml",), "main")
    assert head_revision(repo.root) is None
    repo.write("state/bench/state.json")
    committed(repo)
    assert repo.last_files() == ["state/bench/state.json"]
    assert repo.git("status", "--porcelain") == "?? octopus.yaml"


def test_every_way_to_be_dirty_and_none(repo: Project) -> None:
    repo.write(".gitignore", "ignored.md\n")
    names = ["clean.md", "edited.md", "staged.md", "gone.md", "renamed.md", "sp ace ü\n.md"]
    for name in names:
        repo.write(name)
    revision = repo.commit_all()
    repo.write("edited.md", "y")
    repo.write("staged.md", "y")
    repo.git("add", "staged.md")
    (repo.root / "gone.md").unlink()
    repo.git("mv", "renamed.md", "new.md")
    for name in ("untracked.md", "ignored.md", "not-asked.md", "sp ace ü\n.md"):
        repo.write(name, "z")
    asked = [*names, "new.md", "untracked.md", "ignored.md", "never-there.md", "*.md"]
    facts, _ = repository_facts(repo.root, [*(repo.root / name for name in asked), Path("/etc/hostname")])
    assert facts is not None and facts.revision == revision
    dirty = ["edited.md", "gone.md", "ignored.md", "new.md", "renamed.md", "sp ace ü\n.md", "staged.md", "untracked.md"]
    assert list(facts.dirty) == dirty


def test_a_project_below_the_root_names_paths_from_itself(repo: Project) -> None:
    project = repo.root / "hosts/bench"
    inside = repo.write("hosts/bench/octopus.yaml")
    shared = repo.write("profiles/arm.md")
    facts, _ = repository_facts(project, [inside, shared])
    assert facts is not None and facts.dirty == ("../../profiles/arm.md", "octopus.yaml")
    repo.write("hosts/bench/state/s")
    revision, found = commit(project, [project / "state"], "m", {})
    assert found == [] and revision == head_revision(project)
    assert repo.last_files() == ["hosts/bench/state/s"]


def test_facts_write_nothing(repo: Project) -> None:
    path = repo.write("octopus.yaml")
    repo.commit_all()
    os.utime(path, (1, 1))  # git would like to refresh its cache now
    before = (repo.root / ".git/index").read_bytes()
    facts, _ = repository_facts(repo.root, [path])
    assert facts is not None and facts.dirty == ()
    assert (repo.root / ".git/index").read_bytes() == before


def test_only_the_given_paths_are_committed_and_the_stage_is_left(repo: Project) -> None:
    repo.write("state/a", "old")
    repo.write("state/gone", "old")
    repo.write("mine.txt", "old")
    repo.commit_all()
    repo.write("state/a", "new")
    repo.write("state/b/c", "new")
    (repo.root / "state/gone").unlink()
    repo.write("mine.txt", "staged")
    repo.git("add", "mine.txt")
    repo.write("mine.txt", "edited after staging")
    repo.write("added.txt", "staged")
    repo.git("add", "added.txt")
    committed(repo)
    assert repo.last_files() == ["state/a", "state/b/c", "state/gone"]
    assert repo.git("diff", "--cached", "--name-only").split() == ["added.txt", "mine.txt"]
    assert repo.git("show", ":mine.txt") == "staged"
    assert repo.git("status", "--porcelain", "--", "state") == ""


def test_the_message_has_trailers_that_git_reads(repo: Project) -> None:
    repo.write("state/a")
    revision, _ = commit(repo.root, [repo.root / "state"], "Apply bench", {**TRAILERS, "Octoform-Model": "a\nb: c"})
    assert revision is not None
    text = repo.git("log", "-1", "--format=%s|%(trailers:only,unfold)")
    assert text.split("|")[0] == "Apply bench"
    assert text.split("|")[1].splitlines() == [
        "Octoform-Host: bench",
        "Octoform-Serial: 3",
        "Octoform-Model: a b: c",
    ]


def test_nothing_changed_is_no_commit(repo: Project) -> None:
    repo.write("state/a")
    before = committed(repo)
    assert commit(repo.root, [repo.root / "state", repo.root / "absent"], "m", {}) == (None, [])
    assert head_revision(repo.root) == before


def test_a_detached_head_moves_alone(repo: Project) -> None:
    repo.write("a")
    first = repo.commit_all()
    repo.git("checkout", "-q", "--detach")
    repo.write("state/a")
    committed(repo)
    assert repo.git("rev-parse", "main") == first
    facts, _ = repository_facts(repo.root, [])
    assert facts is not None and facts.branch is None


def test_without_an_identity_octoform_s_own(tmp_path: Path) -> None:
    repo = Project(tmp_path / "anonymous")
    repo.git("init", "-q")
    repo.write("state/a")
    committed(repo)
    assert repo.git("log", "-1", "--format=%an <%ae> %cn <%ce>") == (
        "octoform <octoform@localhost> octoform <octoform@localhost>"
    )


def test_the_person_s_identity_comes_first(repo: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    repo.write("state/a")
    committed(repo)
    assert repo.git("log", "-1", "--format=%an <%ae> %cn") == "Ada <ada@example.org> Ada"
    repo.git("config", "--unset", "user.email")
    monkeypatch.setenv("GIT_AUTHOR_EMAIL", "env@example.org")
    repo.write("state/a", "2")
    committed(repo)
    assert repo.git("log", "-1", "--format=%an <%ae> %ce") == "Ada <env@example.org> octoform@localhost"


def test_a_commit_that_is_refused_leaves_no_trace(repo: Project) -> None:
    repo.write("mine", "1")
    first = repo.commit_all()
    repo.write("mine", "2")
    repo.git("add", "mine")
    lock = repo.write(".git/refs/heads/main.lock")
    repo.write("state/a")
    before = (repo.root / ".git/index").read_bytes()
    revision, [problem] = commit(repo.root, [repo.root / "state"], "m", {})
    assert revision is None and problem.code == "GIT-COMMIT-FAILED"
    assert "main.lock" in (problem.detail or "")
    lock.unlink()
    assert head_revision(repo.root) == first
    assert (repo.root / ".git/index").read_bytes() == before
    assert [path.name for path in (repo.root / ".git").glob("index*")] == ["index"]


def test_a_merge_under_way_is_not_concluded(repo: Project) -> None:
    repo.write("a", "1")
    repo.commit_all()
    repo.git("checkout", "-q", "-b", "other")
    repo.write("b")
    repo.commit_all()
    repo.git("checkout", "-q", "main")
    repo.write("c")
    repo.commit_all()
    repo.git("merge", "-q", "--no-commit", "other")
    repo.write("state/a")
    before = head_revision(repo.root)
    revision, [problem] = commit(repo.root, [repo.root / "state"], "m", {})
    assert revision is None and problem.code == "GIT-BUSY" and "merge" in problem.summary
    assert head_revision(repo.root) == before
    assert (repo.root / ".git/MERGE_HEAD").exists()


def test_ignored_state_is_said(repo: Project) -> None:
    repo.write(".gitignore", "state/\n")
    repo.write("state/a")
    revision, [problem] = commit(repo.root, [repo.root / "state"], "m", {})
    assert revision is None and problem.code == "GIT-IGNORED"


def test_names_are_names_and_no_patterns(repo: Project) -> None:
    repo.write("st*te/a")
    repo.write("state/b")
    committed(repo, "st*te")
    assert repo.last_files() == ["st*te/a"]


def test_bytecode_beside_a_server_is_not_committed(repo: Project) -> None:
    repo.write("state/bench/serve/server.py")
    repo.write("state/bench/serve/__pycache__/server.cpython-311.pyc")
    revision, found = commit(repo.root, [repo.root / "state" / "bench"], "m", TRAILERS)
    assert revision and found == []
    assert repo.last_files() == ["state/bench/serve/server.py"]


def test_worktree_and_submodule(repo: Project, tmp_path: Path) -> None:
    repo.write("a")
    repo.commit_all()
    repo.git("worktree", "add", "-q", "-b", "side", str(tmp_path / "tree"))
    inner = Project(tmp_path / "inner")
    inner.git("init", "-q", "-b", "main")
    inner.write("b")
    inner.git("-c", "user.name=x", "-c", "user.email=x@y", "add", "-A")
    inner.git("-c", "user.name=x", "-c", "user.email=x@y", "commit", "-q", "-m", "b")
    repo.git("-c", "protocol.file.allow=always", "submodule", "add", "-q", str(inner.root), "sub")
    main = head_revision(repo.root)
    for place in (tmp_path / "tree", repo.root / "sub"):
        project = Project(place)
        project.write("state/x")
        committed(project)
        assert project.last_files() == ["state/x"]
        assert project.git("status", "--porcelain") == ""
    assert head_revision(repo.root) == main


def test_a_bare_repository_is_none(tmp_path: Path) -> None:
    project = Project(tmp_path / "bare.git")
    project.git("init", "-q", "--bare")
    assert repository_facts(project.root, []) == (None, [])
    assert commit(project.root, [project.root], "m", {}) == (None, [])


def test_called_from_a_hook_of_another_repository(
    repo: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = Project(tmp_path / "other")
    other.git("init", "-q")
    monkeypatch.setenv("GIT_DIR", str(other.root / ".git"))
    monkeypatch.setenv("GIT_INDEX_FILE", str(other.root / ".git/index"))
    path = repo.write("state/a")
    revision, found = commit(repo.root, [path], "m", {})
    assert found == [] and revision == head_revision(repo.root)
    assert head_revision(other.root) is None
    facts, _ = repository_facts(repo.root, [path])
    assert facts is not None and (facts.revision, facts.dirty) == (revision, ())


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, "{other}/.git") for name in ("GIT_DIR", "GIT_COMMON_DIR")),
        *((name, "{other}/.git/objects") for name in ("GIT_OBJECT_DIRECTORY", "GIT_QUARANTINE_PATH")),
        *((name, "1") for name in ("GIT_ICASE_PATHSPECS", "GIT_GLOB_PATHSPECS")),
    ],
)
def test_no_variable_of_a_calling_git_is_obeyed(
    repo: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: str
) -> None:
    other = Project(tmp_path / "other")
    other.git("init", "-q")
    repo.write("a")
    repo.commit_all()
    path = repo.write("state/a")
    with monkeypatch.context() as inherited:
        inherited.setenv(name, value.format(other=other.root))
        revision, found = commit(repo.root, [path], "m", {})
        facts, more = repository_facts(repo.root, [path])
    assert found == more == [] and facts is not None
    assert revision == facts.revision == repo.git("rev-parse", "HEAD")
    assert repo.git("status", "--porcelain") == ""
    assert [each for each in (other.root / ".git/objects").rglob("*") if each.is_file()] == []


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give a folder away")
def test_the_owner_is_checked_also_below_a_calling_git(repo: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    path = repo.write("state/a")
    os.chown(repo.root / ".git", 61234, 61234)
    monkeypatch.setenv("GIT_DIR", str(repo.root / ".git"))
    _, [problem] = repository_facts(repo.root, [path])
    revision, [refused] = commit(repo.root, [path], "m", {})
    assert revision is None and problem.code == refused.code == "GIT-UNUSABLE"
    assert "safe.directory" in (problem.detail or "")


@pytest.mark.parametrize("tracked", [False, True])
def test_a_sparse_checkout_that_leaves_the_state_out(repo: Project, tracked: bool) -> None:
    repo.write("specs/a")
    if tracked:
        repo.write("state/bench/state.json", "former")
    repo.commit_all()
    repo.git("sparse-checkout", "set", "--cone", "specs")
    repo.write("state/bench/state.json")
    committed(repo)
    assert repo.last_files() == ["state/bench/state.json"]
    assert repo.git("status", "--porcelain") == ""


@pytest.mark.parametrize(
    "name",
    [
        *(".git/index", ".git/config", ".git/packed-refs", ".git/refs/heads/main", ".git/logs/HEAD", ".git/shallow"),
        *(".git/objects/info/alternates", ".git/objects/info/commit-graph", ".git/objects/pack/pack-1.idx"),
        *(".git/info/exclude", ".gitignore", ".gitattributes", ".mailmap", "state/bench/.gitignore"),
    ],
)
def test_no_pipe_holds_git_up(repo: Project, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    repo.write("a")
    path = repo.write("state/bench/state.json").parent
    repo.commit_all()
    monkeypatch.setattr(git_access, "SECONDS", 5)  # this test's own patience
    (repo.root / name).unlink(missing_ok=True)
    os.mkfifo(repo.root / name)
    facts, [problem] = repository_facts(repo.root, [path])
    revision, [refused] = commit(repo.root, [path], "m", {})
    assert (facts, revision, problem.code, refused.code) == (None, None, "GIT-UNUSABLE", "GIT-UNUSABLE")
    assert name in (problem.detail or "") and "git would wait" in (problem.detail or "")
    assert kept(repo.root, [path]) == frozenset()
    list(versions(repo.root, path))  # comes to an end


def test_a_broken_repository_is_a_warning(repo: Project) -> None:
    path = repo.write("octopus.yaml")
    repo.write(".git/config", "[core\n")
    facts, [problem] = repository_facts(repo.root, [path])
    assert facts is None and problem.code == "GIT-UNUSABLE" and problem.severity.value == "warning"


def test_an_index_that_is_locked_delays_only_the_index(repo: Project) -> None:
    repo.write("a")
    repo.commit_all()
    repo.write("state/a")
    lock = repo.write(".git/index.lock")
    revision, [problem] = commit(repo.root, [repo.root / "state"], "m", {})
    assert revision == head_revision(repo.root) and problem.code == "GIT-INDEX-BEHIND"
    lock.unlink()
    repo.git("reset", "-q", "--", "state")
    assert repo.git("status", "--porcelain") == ""


def test_without_a_git_program(repo: Project) -> None:
    """In a process of its own, since the library looks for the program once."""
    program = (
        "import sys; from pathlib import Path; from octoform.state.git_repository import repository_facts;"
        "print([item.code for item in repository_facts(Path(sys.argv[1]), [])[1]])"
    )
    environment = {"PATH": str(repo.root), "PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, "-c", program, str(repo.root)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (run.stdout.strip(), run.returncode) == ("['GIT-UNUSABLE']", 0), run.stderr


@pytest.mark.parametrize("key", ["core.excludesFile", "core.attributesFile", "mailmap.file"])
def test_no_pipe_that_a_setting_names_holds_git_up(repo: Project, key: str, monkeypatch: pytest.MonkeyPatch) -> None:
    path = repo.write("state/a")
    monkeypatch.setattr(git_access, "SECONDS", 5)  # this test's own patience
    os.mkfifo(repo.root / "pipe")
    repo.git("config", key, "pipe")
    facts, [problem] = repository_facts(repo.root, [path])
    assert facts is None and problem.code == "GIT-UNUSABLE" and "git would wait" in (problem.detail or "")
    repo.git("config", key, os.devnull)  # which means none
    facts, found = repository_facts(repo.root, [path])
    assert found == [] and facts is not None


def test_git_is_not_called_with_settings_that_it_cannot_list(repo: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    """Which programs they name is not known: the next call may find what the list did not show."""
    path = repo.write("state/a")
    monkeypatch.setattr(git_access, "LISTING_SECONDS", 1)
    os.mkfifo(repo.root / "more")
    repo.git("config", "include.path", "../more")
    called = repo.root.parent / "called"
    script = f'#!/bin/sh\necho "$*" >> {called}\nexec {shutil.which("git")} "$@"\n'
    repo.write("bin/git", script).chmod(0o755)
    monkeypatch.setenv("PATH", f"{repo.root / 'bin'}:{os.environ['PATH']}")
    facts, [problem] = repository_facts(repo.root, [path])
    revision, [refused] = commit(repo.root, [path], "m", {})
    assert (facts, revision, problem.code, refused.code) == (None, None, "GIT-UNUSABLE", "GIT-UNUSABLE")
    assert all(" config " in line for line in called.read_text().splitlines())


def test_other_settings_than_those_that_it_obeys_are_not_listed(repo: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    path = repo.write("state/a")
    repo.write(".gitattributes", "* filter=own\n")
    mark = repo.root.parent / "mark"
    repo.git("config", "filter.own.clean", f"touch {mark}; cat")
    monkeypatch.setenv("GIT_CONFIG", str(repo.write("other")))
    committed(repo)
    facts, found = repository_facts(repo.root, [path])
    assert found == [] and facts is not None and not mark.exists()


def test_with_a_git_that_shows_no_scope_no_setting_is_taken_for_the_persons(
    repo: Project, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = repo.write("bin/git", "#!/bin/sh\nexit 129\n")
    old.chmod(0o755)
    monkeypatch.setenv("PATH", f"{old.parent}:{os.environ['PATH']}")
    facts, [problem] = repository_facts(repo.root, [])
    assert facts is None and problem.code == "GIT-UNUSABLE" and "older than 2.26" in (problem.detail or "")


@pytest.mark.parametrize("once_sparse", [False, True])
def test_a_git_that_has_no_option_for_a_sparse_checkout_commits(
    repo: Project, once_sparse: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if once_sparse:
        repo.git("config", "core.sparseCheckout", "false")  # what `git sparse-checkout disable` leaves
    repo.write("state/bench/state.json")
    script = f'#!/bin/sh\ncase " $* " in *" --sparse "*) exit 129;; esac\nexec {shutil.which("git")} "$@"\n'
    former = repo.write("bin/git", script)
    former.chmod(0o755)
    monkeypatch.setenv("PATH", f"{former.parent}:{os.environ['PATH']}")
    committed(repo)
    assert repo.last_files() == ["state/bench/state.json"]


def test_an_answer_about_the_repository_takes_two_calls(repo: Project, monkeypatch: pytest.MonkeyPatch) -> None:
    """One for its settings, one for the answer, although the person's own settings name programs."""
    path = repo.write("octopus.yaml")
    (repo.root.parent / "home").mkdir()
    repo.git("config", "--global", "filter.lfs.clean", "cat")
    log = repo.root.parent / "log"
    counted = repo.write("bin/git", f'#!/bin/sh\necho >> {log}\nexec {shutil.which("git")} "$@"\n')
    counted.chmod(0o755)
    monkeypatch.setenv("PATH", f"{counted.parent}:{os.environ['PATH']}")
    facts, found = repository_facts(repo.root, [path])
    assert found == [] and facts is not None and (facts.revision, facts.branch) == (None, "main")
    assert facts.dirty == ("octopus.yaml",) and log.read_text() == "\n\n"


def test_the_revision_is_read_wherever_git_keeps_it(repo: Project) -> None:
    repo.write("a")
    revision = repo.commit_all()
    repo.git("pack-refs", "--all")
    assert not (repo.root / ".git/refs/heads/main").exists()
    assert head_revision(repo.root) == revision
    repo.write("b")
    assert repo.commit_all() == head_revision(repo.root) != revision
    repo.git("checkout", "-q", "-b", "a/branch/with/slashes")
    assert head_revision(repo.root / "no" / "such" / "folder") == head_revision(repo.root)
    repo.git("symbolic-ref", "refs/heads/alias", "refs/heads/main")
    repo.git("symbolic-ref", "HEAD", "refs/heads/alias")
    assert head_revision(repo.root) == repo.git("rev-parse", "HEAD")


@pytest.mark.parametrize("head", ["", "nonsense", "ref: refs/heads/.invalid", "ref: ../../../etc/passwd", "ref: HEAD"])
def test_a_head_that_names_no_revision(repo: Project, head: str) -> None:
    repo.write("a")
    repo.commit_all()
    repo.write(".git/HEAD", head + "\n")
    assert head_revision(repo.root) is None
