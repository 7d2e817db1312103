"""A fresh clone keeps no copies: what is damaged there comes from a commit that holds what the state accepted."""

import subprocess
from pathlib import Path

import pytest

from octoform.engine.unattended.repairs import restore_artifacts
from octoform.state.accepted import accept, file_digest
from octoform.state.layout import Layout
from octoform.state.model import NodeState
from octoform.state.store.store import StateStore

SERVER = b"import os\n\n\ndef tool():\n    return os.name\n\n\n"


def git(folder: Path, *words: str) -> str:
    lines = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org"]
    return subprocess.run(["git", *lines, *words], cwd=folder, capture_output=True, text=True, check=True).stdout


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Layout:
    """A project below the top of a clone, whose newest commit holds another server than the state accepted."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    origin = tmp_path / "origin"
    layout = Layout(origin / "plant", "bench")
    layout.committed.mkdir(parents=True)
    git(origin, "init", "-q", "-b", "main")
    (layout.project / ".gitignore").write_text(".octoform/\n")
    store, _ = StateStore.open(layout)
    assert store is not None
    for node, files in {"probe": {"output.json": b"{}\n"}, "serve": {"server.py": SERVER, "runtime/a.py": b""}}.items():
        assert accept(layout, node, files) == []
        assert store.success(node, NodeState(key="k", file_digest=file_digest(layout, node) or "")) == []
    assert store.commit_snapshot() == []
    git(origin, "add", "-A")
    git(origin, "commit", "-qm", "accepted")
    layout.output("serve").write_bytes(b"import sys\n")
    git(origin, "commit", "-qam", "an edit by hand")
    git(tmp_path, "clone", "-q", str(origin), "clone")
    return Layout(tmp_path / "clone" / "plant", "bench")


def test_damaged_artifacts_come_from_git_and_index_and_work_tree_stay(clone: Layout) -> None:
    root = clone.project.parent
    (root / "mine.txt").write_text("staged\n")
    git(root, "add", "mine.txt")
    clone.output("serve").write_bytes(SERVER[:11])
    clone.output("probe").unlink()
    index = (root / ".git" / "index").read_bytes()
    done = restore_artifacts(clone)
    assert sorted(each.rpartition("/")[2] for each in done.back) == ["output.json (missing)", "server.py (truncated)"]
    assert (done.lost, done.failed, done.left) == ([], [], [])
    assert clone.output("serve").read_bytes() == SERVER
    assert (root / ".git" / "index").read_bytes() == index
    assert git(root, "diff", "--cached", "--name-only").split() == ["mine.txt"]


def test_what_no_commit_holds_is_lost_and_nothing_is_guessed(clone: Layout) -> None:
    store, _ = StateStore.open(clone)
    assert store is not None
    known = store.snapshot.nodes["serve"]
    assert store.success("serve", known.model_copy(update={"file_digest": "sha256:" + "0" * 64})) == []
    assert store.commit_snapshot() == []
    clone.output("serve").write_bytes(b"")
    done = restore_artifacts(clone)
    assert (done.back, clone.output("serve").read_bytes()) == ([], b"")
    assert len(done.lost) == 1 and "neither a kept copy nor a commit" in done.lost[0]
