"""A rewritten server takes the accepted one's place as a whole, also when the run is killed at any moment of it."""

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from adopted import BEFORE, GRAPH, NEW, OLD, RUNTIME, Crash, Killed, host, is_whole, opened

from octoform.apply.context import CANDIDATE, Context
from octoform.apply.rewrite import promotion
from octoform.diagnostics import error
from octoform.state.layout import Layout
from octoform.state.store.store import Ports


@pytest.fixture(autouse=True)
def few_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """One module beside the server in place of some thirty, and no environment, which costs seconds to build."""
    monkeypatch.setattr(promotion, "runtime_files", lambda: RUNTIME)
    unbuilt = error("ENDPOINT-BUILD-FAILED", "there is nothing here to publish an endpoint with")
    monkeypatch.setattr(promotion, "build", lambda layout, text: (None, (unbuilt,)))


@pytest.fixture
def folder() -> Iterator[Path]:
    """A folder in memory where there is one: these tests wait for nothing but the disk."""
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as name:
        yield Path(name)


def adopt(layout: Layout, crash: Any) -> None:
    """The adoption itself, all but the endpoint."""
    context = SimpleNamespace(
        layout=layout, store=opened(layout, Ports(checkpoint=crash)), graph=GRAPH, checkpoint=crash
    )
    found = promotion.adopt(cast(Context, context), "step.arm", NEW)
    assert [item.code for item in found] == ["ENDPOINT-BUILD-FAILED"]


def test_the_server_is_adopted_with_all_that_rests_on_it(folder: Path) -> None:
    layout = host(folder)
    adopt(layout, lambda name: None)
    assert is_whole(layout, NEW)
    serve = opened(layout).snapshot.nodes["serve"]
    assert serve.detail == {"tools": 2, "lines": 2, "rewritten": {"by": "step.arm", "former": BEFORE}}
    assert serve.key_parts["spec"] == "serve"
    assert (layout.local / promotion.FORMER).read_text() == OLD
    assert not (layout.local / promotion.RECORD).exists()


def test_a_run_that_is_killed_at_any_moment_is_finished_by_the_next(folder: Path) -> None:
    finished = 0
    for moments in range(200):
        layout = host(folder / str(moments))
        try:
            adopt(layout, Crash(moments))
        except Killed:
            result, found = promotion.resume(layout, opened(layout), GRAPH)
            assert found == []
        else:
            break
        if result:
            finished += 1
            assert is_whole(layout, NEW)
            # How the endpoint was published is not known: it is made anew.
            assert not (layout.endpoint / "check.json").exists()
        else:
            assert is_whole(layout, layout.output("serve").read_text())
        assert not (layout.local / promotion.RECORD).exists()
        assert promotion.resume(layout, opened(layout), GRAPH) == ((), [])
    else:
        raise AssertionError("it never came to its end")
    assert finished > 10


def test_what_was_recorded_for_another_server_is_dropped(folder: Path) -> None:
    layout = host(folder)
    with pytest.raises(Killed):
        adopt(layout, Crash(0))
    assert (layout.local / promotion.RECORD).exists()
    store = opened(layout)
    serve = store.snapshot.nodes["serve"].model_copy(update={"output_digest": "sha256:other"})
    assert store.success("serve", serve) == []
    assert promotion.resume(layout, store, GRAPH) == ((), [])
    assert layout.output("serve").read_text() == OLD
    assert not (layout.local / promotion.RECORD).exists()


def test_half_a_record_is_none(folder: Path) -> None:
    layout = host(folder)
    for text in ("", "{}", '{"node": 1}', '{"node":"a","base":"b","digest":"c","source":"d"}'):
        (layout.local / promotion.RECORD).write_text(text)
        assert promotion.resume(layout, opened(layout), GRAPH) == ((), [])
    assert is_whole(layout, OLD)


def test_the_server_that_is_tried_lies_outside_of_the_accepted_artifacts(folder: Path) -> None:
    layout, trial = Layout(folder, "bench"), promotion.Candidate(folder, "bench")
    assert trial.output("serve") == layout.local / CANDIDATE / "server.py"
    assert trial.runtime == trial.output("serve").parent / "runtime"
    assert trial.output("interface") == layout.output("interface") and trial.socket == layout.socket
