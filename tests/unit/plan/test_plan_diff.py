"""diff: every cause gives its action and its reason, and nothing else moves."""

from collections.abc import Mapping
from dataclasses import replace

import pytest
from unit.plan.settled_graph import FILES, GRAPH, OUTPUTS, observed, settled

from octoform.graph.model import Agent, Graph, NodeKind
from octoform.plan.diff import Observed, Prior, Wishes, diff
from octoform.plan.model import Action, Cause, PlannedAction


def plan(prior: Mapping[str, Prior], seen: Observed, wishes: Wishes | None = None) -> dict[str, PlannedAction]:
    return {item.node: item for item in diff(GRAPH, prior, seen, wishes or Wishes())}


def test_nothing_moved_nothing_to_do() -> None:
    assert {item.action for item in plan(settled(), observed()).values()} == {Action.NOOP}


def test_an_empty_state_creates_everything_for_certain() -> None:
    actions = plan({}, observed())
    assert [(item.action, item.certain) for item in actions.values()] == [(Action.CREATE, True)] * 6
    assert actions["probe"].calls_agent
    assert not actions["endpoint"].calls_agent


def test_a_changed_spec_updates_its_stage_and_leaves_the_rest_open() -> None:
    prior = settled()
    parts = {**prior["identify"].key_parts, "spec": "sha256:older"}
    actions = plan(settled(identify=Prior("accepted", parts, OUTPUTS["identify"], FILES["identify"])), observed())
    assert actions["probe"].action is Action.NOOP
    assert (actions["identify"].action, actions["identify"].certain) == (Action.UPDATE, True)
    reason = actions["identify"].reasons[0]
    assert (reason.cause, reason.part, reason.before, reason.after) == (
        Cause.CHANGED,
        "spec",
        "sha256:older",
        "sha256:spec-identify",
    )
    assert [actions[name].certain for name in ("interface", "serve", "deploy", "endpoint")] == [False] * 4
    assert actions["interface"].reasons[0].cause is Cause.UPSTREAM


def test_moved_hardware_is_probes_affair_and_says_what_moved() -> None:
    seen = observed(fingerprint="sha256:other", hardware=("appeared usb:v1d6b", "gone pci:v8086"))
    actions = plan(settled(), seen)
    assert actions["probe"].reasons[0].text == "appeared usb:v1d6b; gone pci:v8086"
    assert [item.certain for item in actions.values()] == [True, False, False, False, False, False]


@pytest.mark.parametrize(
    ("change", "cause", "action"),
    [
        ({"files": {**FILES, "interface": None}}, Cause.ARTIFACT_DELETED, Action.CREATE),
        ({"files": {**FILES, "interface": "sha256:edited"}}, Cause.ARTIFACT_EDITED, Action.UPDATE),
        ({"links": frozenset({"interface"})}, Cause.ARTIFACT_LINK, Action.REPLACE),
        ({"contract": {"interface": "INTERFACE-BUDGET: too many"}}, Cause.CONTRACT, Action.UPDATE),
    ],
)
def test_drift_of_an_artifact(change: dict[str, object], cause: Cause, action: Action) -> None:
    actions = plan(settled(), observed(**change))
    assert (actions["interface"].action, actions["interface"].reasons[0].cause) == (action, cause)
    assert actions["identify"].action is Action.NOOP


def test_a_new_answer_is_one_reason_also_where_the_accepted_output_contradicts_it() -> None:
    spoken = replace(GRAPH.nodes[1], parts={**GRAPH.nodes[1].parts, "answer.usb-1": "a pump"})
    graph = Graph((GRAPH.nodes[0], spoken, *GRAPH.nodes[2:]))
    broken = observed(contract={"identify": "IDENTIFY-ANSWER-IGNORED: usb-1 is unknown"})
    action = diff(graph, settled(), broken, Wishes())[1]
    assert [(item.cause, item.part) for item in action.reasons] == [(Cause.CHANGED, "answer.usb-1")]


def test_drift_of_the_endpoint_concerns_the_endpoint_alone() -> None:
    actions = plan(settled(), observed(endpoint=("the launcher is missing",)))
    assert [item.node for item in actions.values() if item.action is not Action.NOOP] == ["endpoint"]
    assert actions["endpoint"].reasons[0].text == "the launcher is missing"


@pytest.mark.parametrize(("status", "cause"), [("interrupted", Cause.INTERRUPTED), ("failed", Cause.FAILED)])
def test_a_run_that_did_not_end_is_never_taken_for_done(status: str, cause: Cause) -> None:
    prior = settled(serve=Prior(status, {}, OUTPUTS["serve"], FILES["serve"]))
    action = plan(prior, observed())["serve"]
    assert (action.action, action.reasons[0].cause, action.certain) == (Action.UPDATE, cause, True)
    never = plan(settled(serve=Prior(status, {}, "", "")), observed())["serve"]
    assert (never.action, never.reasons[0].cause, never.certain) == (Action.CREATE, cause, True)


def test_taint_and_replace_replace() -> None:
    known = settled()["serve"]
    tainted = settled(serve=Prior("accepted", known.key_parts, known.output_digest, known.file_digest, tainted=True))
    assert plan(tainted, observed())["serve"].action is Action.REPLACE
    assert plan(settled(), observed(), Wishes(replace=frozenset({"serve"})))["serve"].action is Action.REPLACE


def test_a_target_keeps_everything_else_as_it_is() -> None:
    actions = plan({}, observed(), Wishes(targets=GRAPH.upstream(["identify"])))
    assert [item.node for item in actions.values() if item.action is not Action.NOOP] == ["probe", "identify"]


def test_ignored_parts_do_not_count() -> None:
    known = settled()["serve"]
    parts = {**known.key_parts, "model": "another", "harness": "command"}
    prior = settled(serve=Prior("accepted", parts, known.output_digest, known.file_digest))
    assert plan(prior, observed())["serve"].action is Action.UPDATE
    ignoring = Wishes(ignore=frozenset({"model", "harness"}))
    assert plan(prior, observed(), ignoring)["serve"].action is Action.NOOP


def test_whom_a_stage_asks_next_is_planned_where_its_agent_runs() -> None:
    graph = Graph(
        tuple(
            replace(node, escalate=Agent("next", "m")) if node.kind is NodeKind.STAGE else node for node in GRAPH.nodes
        )
    )
    for prior, expected in (({}, Agent("next", "m")), (settled(), None)):
        actions = {item.node: item for item in diff(graph, prior, observed(), Wishes())}
        assert actions["identify"].escalate == expected
        assert actions["endpoint"].escalate is None
