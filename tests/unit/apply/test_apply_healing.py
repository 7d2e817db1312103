"""A repair and its way back are whole at every moment: killed anywhere, the former server can be had again."""

import os
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest
from adopted import AFTER, BEFORE, GRAPH, NEW, OLD, RUNTIME, Crash, Killed, host, is_whole, opened

from octoform.apply import heal
from octoform.apply.context import Clock, Context
from octoform.apply.duty import LogSlice
from octoform.apply.heal import Case, roll_back
from octoform.apply.repair_outcome import RepairOutcome
from octoform.apply.rewrite import promotion
from octoform.apply.rewrite.review import Reach
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Diagnostic, error
from octoform.state.files import pass_by
from octoform.state.layout import Layout
from octoform.state.store.store import Ports

EPISODE = {"episode": "e1", "reason": "worse"}


@pytest.fixture(autouse=True)
def few_files(monkeypatch: pytest.MonkeyPatch) -> None:
    """One module beside the server, and an endpoint that is published at once."""
    monkeypatch.setattr(promotion, "runtime_files", lambda: RUNTIME)
    monkeypatch.setattr(promotion, "published", lambda context, smoke=True: [])


@pytest.fixture
def folder() -> Iterator[Path]:
    memory = Path("/dev/shm")
    with tempfile.TemporaryDirectory(dir=memory if os.access(memory, os.W_OK) else None) as name:
        yield Path(name)


def context(layout: Layout, crash: Any = pass_by) -> Context:
    """What a run after the former one works with: the state as it lies there, nothing left half done."""
    store = opened(layout, Ports(checkpoint=crash))
    _, found = promotion.resume(layout, store, GRAPH)
    assert found == []
    fields: Mapping[str, Any] = {
        "layout": layout,
        "store": store,
        "graph": GRAPH,
        "checkpoint": crash,
        "clock": Clock(),
    }
    return cast(Context, SimpleNamespace(**fields, emit=lambda event: None))


def mend(layout: Layout, crash: Any = pass_by) -> list[Diagnostic]:
    case = Case("e1", "tool:t", {"tool": "t"}, Reach(frozenset(), ()), Artifacts(serve=OLD))
    return heal._adopted(context(layout, crash), case, NEW)


def back(layout: Layout, crash: Any = pass_by) -> RepairOutcome:
    return roll_back(context(layout, crash), EPISODE)


def test_a_repair_is_taken_back_and_only_once(folder: Path) -> None:
    layout = host(folder)
    assert mend(layout) == [] and is_whole(layout, NEW)
    assert (answer := back(layout)).ok and answer.changed
    assert is_whole(layout, OLD)
    again = back(layout)
    assert again.ok and not again.changed and is_whole(layout, OLD)
    assert opened(layout).snapshot.nodes["serve"].detail["rewritten"] == {"by": "heal", "former": AFTER}


def test_a_repair_that_is_killed_at_any_moment_can_be_taken_back(folder: Path) -> None:
    known = 0
    for moments in range(200):
        layout = host(folder / str(moments))
        try:
            mend(layout, Crash(moments))
        except Killed:
            answer = back(layout)
            assert is_whole(layout, OLD)
            known += answer.ok
            assert answer.ok or "no repair of the incident" in answer.detail
        else:
            break
    else:
        raise AssertionError("it never came to its end")
    assert known > 10


def test_a_way_back_that_is_killed_at_any_moment_is_gone_to_its_end(folder: Path) -> None:
    for moments in range(200):
        layout = host(folder / str(moments))
        assert mend(layout) == []
        try:
            back(layout, Crash(moments))
        except Killed:
            assert back(layout).ok
            assert is_whole(layout, OLD)
        else:
            break
    else:
        raise AssertionError("it never came to its end")
    assert moments > 10


def test_a_server_that_was_made_again_since_is_not_replaced(folder: Path) -> None:
    layout = host(folder)
    assert mend(layout) == []
    store = opened(layout)
    serve = store.snapshot.nodes["serve"].model_copy(update={"output_digest": "sha256:other"})
    assert store.success("serve", serve) == [] and store.commit_snapshot() == []
    answer = back(layout)
    assert (answer.ok, answer.again) == (False, False) and "made again" in answer.detail
    assert layout.output("serve").read_text() == NEW


def test_a_server_that_does_not_come_up_after_all_is_taken_back_at_once(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    layout = host(folder)
    served = iter([[error("ENDPOINT-NO-ANSWER", "it is silent")], []])
    monkeypatch.setattr(promotion, "published", lambda context, smoke=True: next(served))
    assert [item.code for item in mend(layout)] == ["ENDPOINT-NO-ANSWER"]
    assert is_whole(layout, OLD) and layout.output("serve").read_text() == OLD


def test_without_a_copy_nothing_is_replaced(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = host(folder)
    full = error("STATE-DISK-FULL", "no space left")
    monkeypatch.setattr(heal, "write_atomic", lambda *_: full)
    assert mend(layout) == [full]
    assert is_whole(layout, OLD) and opened(layout).snapshot.nodes["serve"].output_digest == BEFORE


def test_the_agent_is_told_which_packages_serve_and_which_must_not_meet(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(heal, "log_excerpt", lambda context, brief: LogSlice("TypeError: no such method"))
    deploy = {
        "requirements": [{"name": "pyserial", "version": "3.5", "why": "the arm"}],
        "conflicts": ["two packages \x1b[31m provide one module"],
    }
    case = Case("e1", "tool:t", {"tool": "t"}, Reach(frozenset(), ()), Artifacts(serve=OLD, deploy=deploy))
    failed = {"id": "r7", "tool": "t", "error": "TypeError", "message": "no such method", "count": 3}
    brief = {"failures": [failed], "since": "2026-01-01T00:00:00Z"}
    given = heal._given(context(host(folder)), case, brief).document
    assert given["packages"] == [{"name": "pyserial", "version": "3.5"}]
    assert given["conflicts"] == ["two packages \\x1b[31m provide one module"]
    assert [(each["id"], each["count"]) for each in given["failures"]] == [("r7", 3)]
    nothing = Case("e1", "tool:t", {"tool": "t"}, Reach(frozenset(), ()), Artifacts(serve=OLD))
    assert heal._given(context(host(folder / "other")), nothing, brief).document["packages"] == []
