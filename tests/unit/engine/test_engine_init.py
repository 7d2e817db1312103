"""A person's start takes the mark of a person's stop away last: a daemon beside it must see no death in between."""

from pathlib import Path

import pytest

from octoform.diagnostics import error
from octoform.endpoint.process import record, start_stop
from octoform.endpoint.process.record import Running
from octoform.engine import endpoint_process as engine
from octoform.state.layout import Layout


@pytest.mark.parametrize("starts", [True, False])
def test_the_mark_goes_when_the_start_has_ended(starts: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    layout = Layout(tmp_path, "bench")
    layout.stop_mark.parent.mkdir(parents=True)
    assert record.mark(layout) is None
    seen: list[bool] = []

    def start(found: Layout) -> tuple[Running | None, object]:
        seen.append(record.is_marked(found))
        return None, None if starts else error("ENDPOINT-START-FAILED", "it does not start")

    monkeypatch.setattr(start_stop, "start", start)
    monkeypatch.setattr(engine, "layout_of", lambda *_: (layout, []))
    engine.start(tmp_path, {})
    assert seen == [True]
    assert not record.is_marked(layout)
