"""For which device a step runs, when it is skipped, and how the endpoint's answers reach its trials."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from octoform.apply import trial_tools as hands
from octoform.apply.context import Clock, Context
from octoform.apply.privileged_step import run_step
from octoform.apply.stage.acceptance import Finished, Verdict
from octoform.apply.stage.assignment import Assignment
from octoform.apply.trial_tools import LiveHand
from octoform.contracts.contract_check import has_shape
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import CallResult, Person
from octoform.graph.model import Graph, Node, NodeKind
from octoform.profiles import load
from octoform.protocol import schema_dir, step_paths
from octoform.protocol.spec_loader import load_step
from octoform.state.layout import STAGES, Layout

ARM = Path(__file__).parents[3] / "profiles" / "so-arm101.md"
FIRST, SECOND = "usb-1a86-55d3", "usb-1a86-55d3-2"


def probed(device: str, words: str = "Feetech") -> dict[str, Any]:
    text = f"idVendor=1a86\nidProduct=55d3\nmanufacturer={words}"
    return {"id": device, "vid": "1a86", "pid": "55d3", "raw_descriptor": text, "classes": ["tty"]}


def annotated(device: str, profile: str | None = "so-arm101") -> dict[str, Any]:
    return {"id": device, "identified_as": "an arm", "category": "actuator", "profile": profile, "capabilities": []}


def moving(*devices: str) -> dict[str, Any]:
    schema = {"type": "object", "properties": {"joint": {"type": "string"}}}
    names = {"name": "arm_move_joint", "capability": "arm_move_joint", "effect": "actuate"}
    return {**names, "devices": list(devices), "input_schema": schema}


def outcome(
    folder: Path, probe: list[Any], identify: list[Any], tools: list[Any], step: str = "arm"
) -> tuple[Verdict, Layout]:
    """What comes of a step on a host of these artifacts; one that would run an agent ends before that."""
    layout = Layout(folder, "bench")
    artifacts = {"probe": {"devices": probe}, "identify": {"devices": identify}, "interface": {"tools": tools}}
    for stage in STAGES:
        layout.output(stage).parent.mkdir(parents=True)
        text = "import runtime\n" if stage == "serve" else json.dumps(artifacts.get(stage, {"imports": []}))
        layout.output(stage).write_text(text)
    profiles, found = load([ARM])
    assert not found
    read, found = load_step(step, step_paths(None)[step], None)
    assert read is not None, found
    nodes = [*(Node(name, NodeKind.STAGE, ()) for name in STAGES), Node(read.node, NodeKind.STEP, ())]
    manifest = SimpleNamespace(answers={}, camera_hint=dict, budget_for=lambda _: SimpleNamespace(tools=30))
    context = SimpleNamespace(
        layout=layout,
        graph=Graph(tuple(nodes)),
        steps={read.node: read},
        profiles=profiles,
        manifest=manifest,
        clock=Clock(),
        schemas=schema_dir(None),
    )
    return run_step(cast(Context, context), read.node).verdict, layout


@pytest.mark.parametrize(
    ("probe", "identify", "tools", "told"),
    [
        ([], [], [], "no device of this host is matched by the profile so-arm101"),
        ([probed(FIRST, "QinHeng")], [annotated(FIRST)], [moving(FIRST)], "no device"),
        ([probed(FIRST)], [annotated(FIRST, None)], [moving(FIRST)], "no device"),
        ([probed(FIRST)], [annotated(FIRST)], [moving("other")], f"{FIRST} has no tool"),
    ],
)
def test_without_evidence_the_step_is_skipped(
    tmp_path: Path, probe: list[Any], identify: list[Any], tools: list[Any], told: str
) -> None:
    verdict, layout = outcome(tmp_path, probe, identify, tools)
    assert verdict.accepted and told in str(verdict.detail["skipped"])
    assert [(item.code, item.severity) for item in verdict.diagnostics] == [("STEP-NOT-CORROBORATED", "warning")]
    assert not layout.attempts.exists()
    assert json.loads(verdict.files["output.json"])["device"] is None
    assert has_shape("step.arm", verdict.value, schema_dir(None))


def test_two_devices_of_one_profile_are_named_and_none_is_moved(tmp_path: Path) -> None:
    both = [FIRST, SECOND]
    verdict, layout = outcome(tmp_path, [*map(probed, both)], [*map(annotated, both)], [moving(*both)])
    (found,) = verdict.diagnostics
    assert found.code == "STEP-SEVERAL-DEVICES" and f"{FIRST}, {SECOND}" in found.summary
    assert not verdict.accepted and not layout.attempts.exists()


def test_no_camera_is_no_failure(tmp_path: Path) -> None:
    verdict, _ = outcome(tmp_path, [probed(FIRST)], [annotated(FIRST)], [moving(FIRST)], "perceive")
    assert verdict.accepted and verdict.detail["skipped"] == "no tool of this host takes a picture"


def test_one_device_with_evidence_and_tools_is_tried(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def fulfil(context: object, assignment: Any) -> Finished:
        asked.append((json.loads(assignment.given), assignment.profiles))
        return cast(Finished, SimpleNamespace(verdict=Verdict(())))

    monkeypatch.setattr("octoform.apply.privileged_step.fulfil", fulfil)
    monkeypatch.setattr("octoform.apply.privileged_step.of_stage", lambda context, node: an_assignment(node))
    outcome(tmp_path, [probed(FIRST)], [annotated(FIRST)], [moving(FIRST), {**moving("other"), "name": "x"}])
    ((given, told),) = asked
    assert told == ("so-arm101",)
    assert given["device"]["id"] == FIRST and [tool["name"] for tool in given["tools"]] == ["arm_move_joint"]
    assert given["proof"] == {"kind": "reading", "minimum": 50.0, "unit": "raw", "settle": 2.0}


def an_assignment(node: str) -> Any:
    return Assignment(node, cast(Any, None), None, cast(Any, None))


def result(**more: Any) -> CallResult:
    fields: dict[str, Any] = {"content": (), "structured": {"n": 1}, "is_error": False, "message": "", "ms": 1.0}
    return CallResult(**{**fields, **more})


@pytest.mark.parametrize(
    ("came", "wanted"),
    [
        ((result(), ()), (False, False)),
        ((result(is_error=True, message="it is stuck"), ()), (False, False)),
        ((result(is_error=True, message="denied", refused="denied"), ()), (True, False)),
        ((result(is_error=True, message="latched", refused="estop"), ()), (True, True)),
        ((result(is_error=True, message="dry run: nothing was done", dry=True), ()), (True, False)),
        ((result(message="dry run: nothing was done", dry=True), ()), (True, False)),
        ((None, (error("ENDPOINT-BAD-ARGUMENT", "too large"),)), (True, False)),
        ((None, (error("ENDPOINT-CALL-TIMEOUT", "no answer"),)), (False, False)),
        ((None, (error("ENDPOINT-DOWN", "it ended"),)), (True, True)),
    ],
)
def test_what_the_endpoint_says_of_a_call(
    monkeypatch: pytest.MonkeyPatch, came: tuple[CallResult | None, tuple[Diagnostic, ...]], wanted: tuple[bool, bool]
) -> None:
    seen: list[ToolCall] = []

    def call(layout: Layout, made: ToolCall, person: Person) -> Any:
        seen.append(made)
        assert person.approves("arm_move_joint", {}, "really?") is True
        return came

    monkeypatch.setattr(hands, "call", call)
    answer = LiveHand(Layout(Path("/nowhere"), "bench")).call("arm_move_joint", {"position": 1})
    assert (answer.refused, answer.over) == wanted
    assert (answer.value is None) == bool(answer.words)
    assert seen[0].approved and seen[0].arguments == {"position": 1}
