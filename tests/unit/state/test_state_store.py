"""The store against a model of it, over any history of steps, commits and re-openings."""

import json
import os
import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from octoform.diagnostics import Diagnostic, error, has_errors
from octoform.state.layout import Layout
from octoform.state.model import GitRecord, NodeState, Snapshot, Status, encode, state_digest
from octoform.state.store import journal
from octoform.state.store import store as stores
from octoform.state.store.journal import Reading
from octoform.state.store.quick_read import backup_path, peek
from octoform.state.store.store import Context, Ports, StateStore

nodes = st.sampled_from(["probe", "identify", "serve"])
details = st.dictionaries(
    st.text(max_size=5), st.integers() | st.text(max_size=5) | st.lists(st.booleans()), max_size=2
)


def opened(layout: Layout, ports: Ports | None = None) -> StateStore:
    store, found = StateStore.open(layout, ports)
    assert store is not None and not has_errors(found), found
    return store


MEMORY = Path("/dev/shm")


class Histories(RuleBasedStateMachine):
    """The model: what each node's last step said, as (status, key, tainted)."""

    @initialize()
    def start(self) -> None:
        self.folder = Path(tempfile.mkdtemp(dir=MEMORY if os.access(MEMORY, os.W_OK) else None))
        self.layout = Layout(self.folder, "bench")
        self.store = opened(self.layout)
        self.model: dict[str, tuple[str, str, bool]] = {}
        self.settled: dict[str, tuple[str, str, bool]] | None = None
        self.serial = 0
        self.lineage: str | None = None

    def teardown(self) -> None:
        shutil.rmtree(self.folder)

    @rule(node=nodes)
    def begin(self, node: str) -> None:
        assert self.store.begin(node) == []
        _, key, tainted = self.model.get(node, ("", "", False))
        self.model[node] = ("interrupted", key, tainted)

    @rule(node=nodes, key=st.text(max_size=4), detail=details, seconds=st.floats(0, 1e9))
    def success(self, node: str, key: str, detail: dict[str, object], seconds: float) -> None:
        state = NodeState(key=key, detail=detail, seconds=seconds, accepted_at="2030-01-01T00:00:00Z")
        assert self.store.success(node, state) == []
        self.model[node] = ("accepted", key, False)

    @rule(node=nodes, text=st.text(max_size=9))
    def failure(self, node: str, text: str) -> None:
        assert self.store.failure(node, [error("PROBE-DUPLICATE-ID", text)]) == []
        _, key, tainted = self.model.get(node, ("", "", False))
        self.model[node] = ("failed", key, tainted)
        assert self.store.snapshot.nodes[node].detail["failure"]["diagnostics"][0]["summary"] == text

    @rule(node=nodes)
    def remove(self, node: str) -> None:
        assert self.store.remove(node) == []
        self.model.pop(node, None)

    @rule(node=nodes)
    def taint(self, node: str) -> None:
        assert self.store.taint(node) == []
        if node in self.model:
            self.model[node] = (*self.model[node][:2], True)

    @rule()
    def commit(self) -> None:
        unsettled = self.store.unsettled
        before = self.layout.snapshot.read_bytes() if self.store.exists else None
        assert self.store.commit_snapshot() == []
        if self.store.exists:
            document = peek(self.layout)
            assert document is not None
            assert document["serial"] in (self.serial, self.serial + 1)
            if document["serial"] == self.serial:
                assert self.layout.snapshot.read_bytes() == before
            elif before is not None:
                assert backup_path(self.layout).read_bytes() == before
            self.serial = document["serial"]
            self.lineage = document["lineage"]
        else:
            assert not unsettled

    @rule()
    def reopen(self) -> None:
        self.store = opened(self.layout)

    @rule()
    def commit_twice_is_once(self) -> None:
        self.commit()
        serial = self.store.snapshot.serial
        assert self.store.commit_snapshot() == []
        assert self.store.snapshot.serial == serial

    @invariant()
    def agrees(self) -> None:
        if not hasattr(self, "store"):
            return
        for store in (self.store, opened(self.layout)):
            seen = {name: (node.status.value, node.key, node.tainted) for name, node in store.snapshot.nodes.items()}
            assert seen == self.model
            assert self.lineage in (None, store.snapshot.lineage)
            assert store.snapshot.serial == self.serial


TestHistories = Histories.TestCase
TestHistories.settings = settings(stateful_step_count=20, suppress_health_check=list(HealthCheck))


@pytest.fixture
def accepted(layout: Layout) -> Layout:
    store = opened(layout)
    store.success("probe", NodeState(key="one"))
    assert store.commit_snapshot(Context("sha256:m")) == []
    return layout


def test_what_was_accepted_survives_a_failed_and_an_interrupted_run(accepted: Layout) -> None:
    store = opened(accepted)
    store.begin("probe", {"attempt": "7-probe-1"})
    assert store.snapshot.nodes["probe"].detail["interrupted"]["attempt"] == "7-probe-1"
    store.failure("probe", [error("PROBE-DUPLICATE-ID", "x")])
    state = store.snapshot.nodes["probe"]
    assert (state.key, state.status) == ("one", Status.FAILED)
    assert "interrupted" not in state.detail


def test_a_new_revision_alone_is_no_new_serial(accepted: Layout) -> None:
    before = accepted.snapshot.read_bytes()
    assert opened(accepted).commit_snapshot(Context("sha256:m", GitRecord(revision="f" * 40))) == []
    assert accepted.snapshot.read_bytes() == before
    assert opened(accepted).commit_snapshot(Context("sha256:n", GitRecord(revision="f" * 40))) == []
    document = json.loads(accepted.snapshot.read_bytes())
    assert (document["serial"], document["git"]["revision"]) == (2, "f" * 40)


def test_fields_of_a_newer_octoform_are_kept(accepted: Layout) -> None:
    document = json.loads(accepted.snapshot.read_bytes())
    document["weather"] = {"sun": True}
    document["nodes"]["probe"]["colour"] = "blue"
    accepted.snapshot.write_text(json.dumps(document))
    store = opened(accepted)
    store.taint("probe")
    assert store.commit_snapshot() == []
    after = json.loads(accepted.snapshot.read_bytes())
    assert after["weather"] == {"sun": True}
    assert after["nodes"]["probe"]["colour"] == "blue" and after["nodes"]["probe"]["tainted"] is True


def test_a_state_that_moved_meanwhile_is_not_overwritten(accepted: Layout) -> None:
    store = opened(accepted)
    store.success("probe", NodeState(key="mine"))
    other = json.loads(accepted.snapshot.read_bytes())
    other["serial"] = 9
    accepted.snapshot.write_text(json.dumps(other))
    found = store.commit_snapshot()
    assert [item.code for item in found] == ["STATE-MOVED"]
    assert json.loads(accepted.snapshot.read_bytes())["serial"] == 9
    again, result = StateStore.open(accepted)
    assert again is not None and again.snapshot.nodes["probe"].key == "one"
    assert [item.code for item in result] == ["STATE-JOURNAL-STALE"]
    assert again.begin("probe") == []
    assert accepted.journal.with_suffix(".stale").exists()
    assert opened(accepted).snapshot.nodes["probe"].status is Status.INTERRUPTED


def test_the_same_state_with_other_line_ends_is_the_same_state(accepted: Layout) -> None:
    store = opened(accepted)
    store.begin("probe")
    accepted.snapshot.write_bytes(accepted.snapshot.read_bytes().replace(b"\n", b"\r\n"))
    again, found = StateStore.open(accepted)
    assert found == [] and again is not None
    assert again.snapshot.nodes["probe"].status is Status.INTERRUPTED


def test_a_deleted_state_is_said_and_its_copy_named(accepted: Layout) -> None:
    store = opened(accepted)
    store.taint("probe")
    store.commit_snapshot()
    accepted.snapshot.unlink()
    again, found = StateStore.open(accepted)
    assert again is not None and again.snapshot.nodes == {}
    assert [item.code for item in found] == ["STATE-MISSING"]
    assert "state.json.backup" in (found[0].hint or "")


def test_another_lineage_is_said(accepted: Layout) -> None:
    store = opened(accepted)
    store.taint("probe")
    store.commit_snapshot()
    accepted.snapshot.write_bytes(encode(Snapshot(octoform="0", host="bench", lineage="another", serial=4)))
    assert [item.code for item in StateStore.open(accepted)[1]] == ["STATE-LINEAGE"]


def test_the_journal_is_bounded(layout: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stores, "JOURNAL_RECORDS", 10)
    store = opened(layout)
    for number in range(100):
        assert store.success("probe", NodeState(key=str(number))) == []
        assert layout.journal.read_bytes().count(b"\n") <= 12
    assert opened(layout).snapshot.nodes["probe"].key == "99"


def test_failures_are_kept_bounded(layout: Layout) -> None:
    store = opened(layout)
    assert store.failure("serve", [error("SERVE-SYNTAX", "x" * 1_000_000)] * 500) == []
    assert layout.journal.stat().st_size < 200_000


def test_a_commit_that_failed_after_the_rename_is_taken_up(accepted: Layout) -> None:
    """The folder could not be synced: the new file is there, the caller got an error, and tries again."""
    trouble = [True]

    def checkpoint(name: str) -> None:
        if name == "snapshot.renamed" and trouble:
            trouble.pop()
            raise OSError(5, os.strerror(5))

    store = opened(accepted, Ports(checkpoint))
    store.success("probe", NodeState(key="two"))
    assert [item.code for item in store.commit_snapshot()] == ["STATE-WRITE-FAILED"]
    assert opened(accepted).snapshot.nodes["probe"].key == "two"
    store.success("serve", NodeState(key="three"))
    assert store.commit_snapshot() == []
    document = peek(accepted)
    assert document is not None
    assert (document["serial"], sorted(document["nodes"])) == (3, ["probe", "serve"])


def test_a_plan_that_reads_while_an_apply_commits(accepted: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commit falls between the reader's look at the snapshot and its look at the journal, and once more after."""
    writer = opened(accepted)
    real = journal.read
    keys = ["two", "three"]

    def read(path: Path) -> tuple[Reading | None, list[Diagnostic]]:
        before = keys[:1] and real(path)
        if keys:
            writer.success("probe", NodeState(key=keys.pop(0)))
            assert writer.commit_snapshot() == []
        return real(path) if len(keys) == 1 else before or real(path)

    monkeypatch.setattr(journal, "read", read)
    store, found = StateStore.open(accepted)
    assert store is not None and found == []
    assert (store.snapshot.nodes["probe"].key, store.snapshot.serial) == ("three", 3)


def test_a_state_that_never_stands_still_is_said(accepted: Layout, monkeypatch: pytest.MonkeyPatch) -> None:
    real = journal.read

    def read(path: Path) -> tuple[Reading | None, list[Diagnostic]]:
        document = json.loads(accepted.snapshot.read_bytes())
        accepted.snapshot.write_text(json.dumps({**document, "serial": document["serial"] + 1}))
        return real(path)

    monkeypatch.setattr(journal, "read", read)
    store, found = StateStore.open(accepted)
    assert store is None and [item.code for item in found] == ["STATE-MOVED"]


def test_reading_writes_nothing(layout: Layout) -> None:
    assert opened(layout).snapshot.nodes == {}
    assert peek(layout) is None
    assert list(layout.project.iterdir()) == []


def test_nothing_to_say_makes_no_state_file(layout: Layout) -> None:
    assert opened(layout).commit_snapshot(Context("sha256:m")) == []
    assert not layout.snapshot.exists()


def test_destroyed_to_nothing_the_lineage_stays(accepted: Layout) -> None:
    store = opened(accepted)
    lineage = store.snapshot.lineage
    store.remove("probe")
    assert store.commit_snapshot() == []
    document = peek(accepted)
    assert document is not None
    assert (document["nodes"], document["lineage"], document["serial"]) == ({}, lineage, 2)


def test_the_file_and_the_memory_have_one_digest(layout: Layout) -> None:
    snapshot = Snapshot(
        octoform="1", host="bench", lineage="l", nodes={"a": NodeState(seconds=3, detail={"t": (1, 2)})}
    )
    assert state_digest(Snapshot.model_validate_json(encode(snapshot))) == state_digest(snapshot)


def test_private_files_are_private_and_ignored_by_git(accepted: Layout) -> None:
    store = opened(accepted)
    store.begin("probe")
    assert accepted.local.stat().st_mode & 0o777 == 0o700
    assert accepted.journal.stat().st_mode & 0o777 == 0o600
    assert (accepted.project / ".octoform/.gitignore").read_text() == "*\n"
    assert accepted.snapshot.stat().st_mode & 0o777 == 0o644 & ~_umask()


def _umask() -> int:
    present = os.umask(0)
    os.umask(present)
    return present
