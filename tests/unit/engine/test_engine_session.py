"""When an agent of the daemon may work on a host, and what is recorded after it has."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from octoform.apply.context import Context
from octoform.apply.repair_outcome import RepairOutcome
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process import record
from octoform.engine.apply.session import Locked, Opened
from octoform.engine.unattended import session
from octoform.state.accepted import accept, file_digest
from octoform.state.layout import STAGES, Layout
from octoform.state.model import Status
from octoform.state.store.lock import acquire

DONE = RepairOutcome.done("heal.rewrite", "done", changed=True)


class Store:
    """A state; ``found`` is its commit's message."""

    def __init__(self, *found: Diagnostic, unsettled: bool = True, nodes: dict[str, Any] | None = None) -> None:
        self.unsettled, self.snapshot, self._found = unsettled, SimpleNamespace(nodes=nodes or {}), found

    def commit_snapshot(self) -> list[Diagnostic]:
        return list(self._found)


def held(layout: Layout, *, commit: bool = False) -> Locked:
    manifest = SimpleNamespace(git=SimpleNamespace(commit=commit))
    return Locked(cast(Any, SimpleNamespace(layout=layout, manifest=manifest)))


def there(store: Store) -> Opened:
    return Opened(cast(Any, store))


@pytest.mark.parametrize(("commit", "wanted"), [(False, []), (True, ["heal"])])
def test_another_server_is_recorded_and_committed_where_the_manifest_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, commit: bool, wanted: list[str]
) -> None:
    layout, made = Layout(tmp_path, "bench"), list[str]()

    def committed(layout: Layout, snapshot: object, name: str) -> tuple[None, list[Diagnostic]]:
        made.append(name)
        return None, []

    monkeypatch.setattr(session, "commit_run", committed)
    assert session._recorded(held(layout, commit=commit), there(Store()), "heal", DONE) == DONE
    assert made == wanted
    assert session._recorded(held(layout, commit=commit), there(Store(unsettled=False)), "heal", DONE) == DONE
    assert made == wanted, "nothing was changed"


def test_what_cannot_be_recorded_is_said_and_the_repair_stands(tmp_path: Path) -> None:
    full = error("STATE-DISK-FULL", "no space left")
    answer = session._recorded(held(Layout(tmp_path, "bench"), commit=True), there(Store(full)), "heal", DONE)
    assert answer.ok and answer.changed and answer.detail == "done; STATE-DISK-FULL: no space left"


def applied(layout: Layout) -> dict[str, Any]:
    for stage in STAGES:
        assert accept(layout, stage, {layout.output(stage).name: b"{}"}) == []
    return {stage: SimpleNamespace(status=Status.ACCEPTED, file_digest=file_digest(layout, stage)) for stage in STAGES}


def test_only_on_what_was_accepted_and_is_as_it_was(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    nodes = applied(layout)
    assert session._unready(held(layout), there(Store(nodes=nodes))) is None
    for changed, code in (({"status": Status.FAILED}, "DUTY-NOT-APPLIED"), ({"file_digest": "x"}, "DUTY-CHANGED")):
        other = SimpleNamespace(**{**vars(nodes["serve"]), **changed})
        found = session._unready(held(layout), there(Store(nodes={**nodes, "serve": other})))
        assert found is not None and found.code == code
    layout.output("serve").write_text("edited")
    found = session._unready(held(layout), there(Store(nodes=nodes)))
    assert found is not None and found.code == "DUTY-CHANGED"
    found = session._unready(held(layout), there(Store()))
    assert found is not None and found.code == "DUTY-NOT-APPLIED"


def test_a_person_who_stopped_the_endpoint_is_not_overruled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = Layout(tmp_path, "bench")
    context = cast(Context, SimpleNamespace(layout=layout, environ={}))
    published = iter([True, False])
    monkeypatch.setattr(session, "is_published", lambda *_: next(published))
    monkeypatch.setattr(session, "service_of", lambda _: None)
    assert session.ready(context) == []
    assert [item.code for item in session.ready(context)] == ["DUTY-CHANGED"]
    assert record.mark(layout) is None
    assert [item.code for item in session.ready(context)] == ["DUTY-STOPPED"]


def test_who_holds_the_state_is_waited_for_and_then_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    monkeypatch.setattr(session, "LOCK_SECONDS", 0.0)
    acquired = acquire(Layout(tmp_path, "bench"), "apply")
    assert acquired.lock is not None
    with acquired.lock:
        answer = session.run_task(tmp_path, {}, "watch", lambda context: DONE)
    assert (answer.ok, answer.again) == (False, True) and "STATE-LOCKED" in answer.detail
    answer = session.run_task(tmp_path, {}, "watch", lambda context: DONE)
    assert (answer.ok, answer.again) == (False, False) and "DUTY-NOT-APPLIED" in answer.detail
    (tmp_path / "octopus.yaml").write_text("version: [")
    assert not session.run_task(tmp_path, {}, "watch", lambda context: DONE).ok
