"""Privileged steps in plans: what makes one run, one that was taken out, plan files and the JSON of a plan."""

from dataclasses import replace
from typing import Any

import pytest

from octoform.graph.model import Graph, Node, NodeKind, key_parts
from octoform.plan import model, planfile
from octoform.plan.diff import Observed, Prior, Wishes, diff, with_reuse
from octoform.plan.model import Action, Cause, Plan, PlannedAction, StepOutlook

STEP = Node("step.lamp", NodeKind.STEP, ("serve",), {"spec": "sha256:spec"}, harness="builtin", after=("endpoint",))
SERVE = Node("serve", NodeKind.STAGE, (), {"spec": "sha256:serve"}, harness="builtin")
ENDPOINT = Node("endpoint", NodeKind.ENDPOINT, ("serve",), {"setting.scope": "local"})
WITH, WITHOUT = Graph((SERVE, ENDPOINT, STEP)), Graph((SERVE, ENDPOINT))
OUTPUTS = {name: f"sha256:out-{name}" for name in WITH.names()}
FILES = {name: f"sha256:file-{name}" for name in WITH.names()}
PRIOR = {
    node.name: Prior("accepted", key_parts(node, OUTPUTS, "sha256:host"), OUTPUTS[node.name], FILES[node.name])
    for node in WITH.nodes
}
SEEN = Observed("sha256:host", FILES)


def plan(
    graph: Graph, prior: dict[str, Prior] = PRIOR, seen: Observed = SEEN, **wishes: Any
) -> dict[str, PlannedAction]:
    return {item.node: item for item in diff(graph, prior, seen, Wishes(**wishes))}


def test_an_accepted_step_is_not_carried_out_again() -> None:
    assert {item.action for item in plan(WITH).values()} == {Action.NOOP}
    restarted = plan(WITH, seen=replace(SEEN, endpoint=("it is down",)))
    assert restarted["endpoint"].action is Action.UPDATE
    assert restarted["step.lamp"].action is Action.NOOP


def test_another_server_is_proved_anew_only_if_it_comes_out_different() -> None:
    changed = replace(PRIOR["serve"], key_parts={**PRIOR["serve"].key_parts, "spec": "sha256:older"})
    action = plan(WITH, {**PRIOR, "serve": changed})["step.lamp"]
    assert (action.action, action.certain, action.calls_agent) == (Action.UPDATE, False, True)


@pytest.mark.parametrize(
    ("seen", "cause", "action"),
    [
        (replace(SEEN, files={**FILES, "step.lamp": None}), Cause.ARTIFACT_DELETED, Action.CREATE),
        (replace(SEEN, files={**FILES, "step.lamp": "sha256:other"}), Cause.ARTIFACT_EDITED, Action.UPDATE),
        (replace(SEEN, links=frozenset({"step.lamp"})), Cause.ARTIFACT_LINK, Action.REPLACE),
        (replace(SEEN, contract={"step.lamp": "STEP-SCHEMA: no"}), Cause.CONTRACT, Action.UPDATE),
    ],
)
def test_the_artifact_of_a_step_is_watched_as_every_other(seen: Observed, cause: Cause, action: Action) -> None:
    found = plan(WITH, seen=seen)["step.lamp"]
    assert ([item.cause for item in found.reasons], found.action) == ([cause], action)


def test_a_step_that_was_taken_out_goes_first() -> None:
    actions = diff(WITHOUT, PRIOR, SEEN, Wishes())
    assert (actions[0].node, actions[0].action) == ("step.lamp", Action.DESTROY)
    assert [item.cause for item in actions[0].reasons] == [Cause.REMOVED]
    assert not actions[0].calls_agent
    assert with_reuse(WITHOUT, actions, PRIOR, {}) == actions


def test_a_run_that_keeps_to_other_nodes_leaves_it_and_so_does_one_of_an_unknown_kind() -> None:
    assert "step.lamp" not in plan(WITHOUT, targets=frozenset({"serve"}))
    assert "watch" not in plan(WITHOUT, {**PRIOR, "watch": PRIOR["step.lamp"]})


def saved(graph: Graph, actions: tuple[PlannedAction, ...]) -> planfile.PlanFile:
    made = Plan("bench", "apply", actions)
    units = planfile.units(graph, made, PRIOR, SEEN)
    document: dict[str, Any] = {"octoform": "1", "host": "bench", "lineage": None, "targets": None, "replace": []}
    return planfile.PlanFile(**document, units=units, plan=model.to_json(made))


def test_a_saved_plan_removes_a_step_unless_it_moved_or_is_wanted_again() -> None:
    document = saved(WITHOUT, diff(WITHOUT, PRIOR, SEEN, Wishes()))
    assert planfile.moved(document, WITHOUT, PRIOR, SEEN) == []
    assert planfile.applicable(document, WITHOUT, []) == {"step.lamp"}
    again = {**PRIOR, "step.lamp": replace(PRIOR["step.lamp"], accepted_at="later")}
    assert [item.part for item in planfile.moved(document, WITHOUT, again, SEEN)] == ["state"]
    assert {item.part for item in planfile.moved(document, WITH, PRIOR, SEEN)} == {"spec", "input.serve"}


def test_what_is_known_of_steps_survives_the_way_through_json() -> None:
    steps = (
        StepOutlook("step.lamp", "dim it", "reading", ("usb-1",), "lamp"),
        StepOutlook("step.arm", "move it", "reading", (), "arm", "usb-2", "LeRobot"),
        StepOutlook("step.fan", "turn it", "view", None),
    )
    made = Plan("bench", "apply", (), steps=steps)
    assert model.from_json(model.to_json(made)) == made
    assert [item.skipped for item in steps] == [False, True, False]
    assert "steps" not in model.to_json(Plan("bench", "apply", ()))
