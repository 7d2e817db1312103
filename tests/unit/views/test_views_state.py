"""The view of a node: how its output came about; and nothing that came with a pull acts there."""

import io
from typing import Any

import pytest

from octoform.state.model import GitRecord, NodeState, Snapshot, Usage
from octoform.views import state as views
from octoform.views.format.console import Console

HOSTILE = "\x1b]0;owned\x07\u202eevil\r\n" + "long " * 1000
REUSED = {
    "host": "bench",
    "project": "../a",
    "serial": 3,
    "accepted_at": "2026-01-02T03:04:05Z",
    "made_for": "first",
    "attempts": 2,
}
ESCALATED = {"harness": "pi", "model": "openai/x", "asked": 3, "still_unknown": 1}


def shown(state: NodeState, name: str = "identify") -> str:
    out = io.StringIO()
    views.node(Console(out, out, False, False, False), name, state, as_json=False)
    return out.getvalue()


def node(detail: dict[str, Any] | None = None, **fields: Any) -> NodeState:
    return NodeState(harness="builtin", attempts=1, seconds=2.5, detail=detail or {}, **fields)


def test_of_a_plain_node_only_its_maker_is_told() -> None:
    text = shown(node({"annotated": 4}))
    assert "made by   builtin, 1 attempt, 2.5 s" in text
    assert "annotated 4" in text
    assert not any(f"  {label} " in text for label in ("reused", "escalated", "spec", "used"))


def test_where_a_reused_output_comes_from() -> None:
    text = shown(node({"reused": REUSED}))
    assert "made by   builtin, for another host; verified here in 2.5 s" in text
    assert "reused    from host bench of project ../a (serial 3), accepted there at 2026-01-02T03:04:05Z; " in text
    assert "; made for host first\n" in text
    assert "host bench of this project (serial 3)" in shown(node({"reused": {**REUSED, "project": "."}}))


def test_who_was_asked_for_the_unknown() -> None:
    assert "escalated pi, openai/x was asked about 3 unknown; 1 still unknown" in shown(node({"escalated": ESCALATED}))
    assert "escalated codex was asked" in shown(node({"escalated": {**ESCALATED, "harness": "codex", "model": None}}))


def test_a_spec_that_an_agent_corrected() -> None:
    text = shown(node({"spec_edit": {"digest": "sha256:a", "base": "sha256:b"}}))
    assert "spec      made with a spec that an agent corrected; octoform spec diff identify" in text


def test_what_was_used_and_who_priced_it() -> None:
    usage = Usage(input_tokens=1200, cached_tokens=200, output_tokens=30, cost_usd=0.5, cost_source="litellm")
    assert "used      1.2k in, 30 out, $0.50, priced by litellm, 200 of them cached" in shown(node(usage=usage))
    assert "used      7 in, cost unknown" in shown(node(usage=Usage(input_tokens=7)))


@pytest.mark.parametrize(
    "value", [HOSTILE, ["x"], 7, None, {}, {"host": ["x"], "harness": {}, "serial": None, "asked": 0}]
)
def test_what_has_another_shape_is_no_reason_to_fail(value: Any) -> None:
    assert "made by" in shown(node(dict.fromkeys(("reused", "escalated", "spec_edit"), value)))


def test_what_a_step_measured_is_told_line_by_line() -> None:
    trials = [
        {"unit": "x", "tool": "move_x", "goal": 1000.0, "moved": 37.5, "found": []},
        {"unit": "y", "tool": "move_y", "goal": 1000.0, "moved": 0.2, "found": ["STEP-NOT-SEEN"]},
    ]
    text = shown(node({"device": "usb-1", "skipped_units": [], "trials": trials}), "step.rail")
    assert "  skipped_units none\n" in text
    assert "  trials    x: tool move_x, goal 1000.0, moved 37.5\n" in text
    assert "            y: tool move_y, goal 1000.0, moved 0.2, found ['STEP-NOT-SEEN']\n" in text


def test_nothing_foreign_acts_on_the_terminal_or_fills_it() -> None:
    many = {f"{HOSTILE}{number}": HOSTILE for number in range(500)}
    detail: dict[str, Any] = {
        **many,
        "reused": dict.fromkeys(REUSED, HOSTILE),
        "escalated": dict.fromkeys(ESCALATED, HOSTILE),
        "spec_edit": {HOSTILE: HOSTILE},
    }
    detail = {"trials": [{"unit": HOSTILE, HOSTILE: HOSTILE}] * 500, **detail}
    usage = Usage(input_tokens=1, cost_usd=1.0, cost_source=HOSTILE)
    state = NodeState(
        key=HOSTILE,
        key_parts={**many, "spec": f"sha256:{HOSTILE}"},
        output_digest=HOSTILE,
        harness=HOSTILE,
        model=HOSTILE,
        usage=usage,
        detail=detail,
    )
    snapshot = Snapshot(
        octoform=HOSTILE,
        host=HOSTILE,
        lineage=HOSTILE,
        git=GitRecord(revision=HOSTILE, dirty=[HOSTILE] * 50),
        nodes={HOSTILE: state},
    )
    out = io.StringIO()
    views.show(Console(out, out, False, False, False), snapshot, as_json=False)
    for text in (out.getvalue(), shown(state, HOSTILE)):
        assert not set(text) & set("\x1b\x07\u202e\r")
        assert "\\x1b" in text
        assert max(map(len, text.splitlines())) < 400
        assert len(text.splitlines()) < 250


def test_a_state_that_was_made_without_what_people_said_says_so() -> None:
    def head(tier1: bool) -> str:
        out = io.StringIO()
        snapshot = Snapshot(octoform="1", host="bench", lineage="l", tier1=tier1, nodes={"identify": node()})
        views.show(Console(out, out, False, False, False), snapshot, as_json=False)
        return out.getvalue()

    assert "(-tier1)" in head(True) and "(-tier1)" not in head(False)
