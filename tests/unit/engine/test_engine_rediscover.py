"""Re-discovery carries out what the hardware asks for, and asks a person about everything else."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from octoform.engine.apply import approval
from octoform.engine.unattended.rediscover import objections
from octoform.graph.model import Graph, Node, NodeKind
from octoform.plan.model import Action, Cause, Plan, PlannedAction, Reason, StepOutlook
from octoform.state.layout import Layout
from octoform.state.model import NodeState, Snapshot

HARDWARE = Reason(Cause.CHANGED, part="hardware", before="a", after="b")
WAITS = Reason(Cause.UPSTREAM, part="input.probe")
PARTS = {"spec": "1", "harness": "builtin", "model": ""}


def outlook(*work: PlannedAction, nodes: dict[str, NodeState] | None = None, ignore: tuple[str, ...] = ()) -> Any:
    """A plan of PROBE, SERVE and two steps, all accepted; ``nodes`` are known otherwise."""
    graph = Graph(
        (
            Node("probe", NodeKind.STAGE, (), PARTS, observes_host=True),
            Node("serve", NodeKind.STAGE, ("probe",), PARTS),
            Node("step.arm", NodeKind.STEP, ("serve",), PARTS),
            Node("step.perceive", NodeKind.STEP, ("serve",), PARTS),
        )
    )
    known = {node.name: NodeState(key_parts={**PARTS, "hardware": "a"}, output_digest="x") for node in graph.nodes}
    steps = (StepOutlook("step.arm", "", "motion", None), StepOutlook("step.perceive", "", "frame", None))
    return SimpleNamespace(
        plan=Plan("bench", "apply", work, steps=steps),
        snapshot=Snapshot(octoform="0", host="bench", lineage="l", nodes={**known, **(nodes or {})}),
        compiled=SimpleNamespace(graph=graph, manifest=SimpleNamespace(lifecycle=SimpleNamespace(ignore=ignore))),
    )


def action(node: str, *reasons: Reason) -> PlannedAction:
    return PlannedAction(node, Action.UPDATE, certain=True, reasons=reasons)


PROBE, SERVE = action("probe", HARDWARE), action("serve", WAITS)


def test_what_only_the_hardware_asks_for_is_done() -> None:
    assert objections(outlook(PROBE, SERVE)) == ()
    assert objections(outlook(PROBE, SERVE, action("step.perceive", WAITS))) == ()


@pytest.mark.parametrize(
    "reason",
    [
        Reason(Cause.CHANGED, part="spec", before="1", after="2"),
        Reason(Cause.CHANGED, part="setting.scope", before="local", after="internet"),
        Reason(Cause.ARTIFACT_EDITED),
        Reason(Cause.ARTIFACT_DELETED),
        Reason(Cause.NEW),
        Reason(Cause.REMOVED),
        Reason(Cause.TAINTED),
        Reason(Cause.CONTRACT, text="SERVE-X: it does not hold"),
    ],
)
def test_what_a_person_has_changed_and_not_applied_is_asked_about(reason: Reason) -> None:
    found = objections(outlook(PROBE, action("serve", reason)))
    assert len(found) == 1 and found[0].startswith(f"serve: {reason.cause.value}")


def test_an_edit_does_not_hide_behind_a_node_that_failed_or_waits() -> None:
    other = {"serve": NodeState(key_parts={**PARTS, "spec": "0", "input.probe": "z"}, output_digest="x")}
    for reason in (Reason(Cause.FAILED), Reason(Cause.INTERRUPTED), WAITS):
        assert objections(outlook(PROBE, action("serve", reason), nodes=other)) == ("serve: changed spec",)
    assert objections(outlook(PROBE, SERVE, nodes=other, ignore=("spec",))) == ()


def test_a_proved_step_does_not_move_its_device_again_and_a_first_proof_is_consented_to() -> None:
    step = action("step.arm", Reason(Cause.UPSTREAM, part="input.serve"))
    assert objections(outlook(PROBE, SERVE, step)) == ("step.arm would be tried again, and that moves hardware",)
    skipped = NodeState(key_parts=PARTS, output_digest="x", detail={"skipped": "no device"})
    assert objections(outlook(PROBE, SERVE, step, nodes={"step.arm": skipped})) == ()
    failed = replace(step, reasons=(Reason(Cause.FAILED),))
    assert objections(outlook(PROBE, SERVE, failed, nodes={"step.arm": NodeState(key_parts=PARTS)})) != ()


def test_a_question_is_asked_once_for_each_change_and_can_be_taken_back(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    question = approval.Question(("create usb:v1F00p00C1",), ("probe", "serve"), ("the manifest says so",))
    assert approval.read(layout) is None
    assert approval.ask(layout, question) == (True, None)
    kept = approval.read(layout)
    assert kept is not None and replace(kept, at="") == question and kept.at
    assert approval.ask(layout, question) == (False, None)
    assert approval.ask(layout, replace(question, hardware=("destroy usb:v1F00p00C1",))) == (True, None)
    for text in ("", "[", '{"format": 2}', '{"format": 1, "hardware": 7}'):
        (layout.daemon / approval.ASKS).write_text(text)
        assert approval.read(layout) is None
    approval.withdraw(layout)
    approval.withdraw(layout)
    assert not (layout.daemon / approval.ASKS).exists()
