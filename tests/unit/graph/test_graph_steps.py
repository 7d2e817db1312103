"""Privileged steps in the graph: behind the endpoint, keyed by what their proof rests on and by nothing else."""

from collections.abc import Mapping
from pathlib import Path

from octoform.apply.stage.serve_feedback import BLAMES
from octoform.graph.compile import compile_graph
from octoform.graph.model import Graph, Node, NodeKind, to_dot, to_mermaid
from octoform.manifest.loader import load
from octoform.profiles import load_text
from octoform.protocol import STAGES, Spec, Step, step_paths
from octoform.protocol.spec_loader import load_step

SPECS = {name: Spec(name, Path(name), "", "", f"sha256:{name}", (), "", None) for name in STAGES}
STEPS = {name: load_step(name, path, None)[0] for name, path in step_paths(None).items()}
ARM = "---\nname: so-arm101\nabout: an arm\nevidence: {text: [Feetech]}\n---\n\nSix servos.\n"


def graph(folder: Path, *names: str, text: str = "", profile: str = ARM) -> Graph:
    (folder / "octopus.yaml").write_text(f"version: 1\nmodel: vendor/name\n{text}\n", "utf-8")
    manifest, found = load(folder / "octopus.yaml", {})
    assert manifest is not None, found
    known, found = load_text(profile, "typed")
    assert known is not None, found
    return compile_graph(manifest, SPECS, (known,), [step(name) for name in names])


def step(name: str) -> Step:
    found = STEPS[name]
    assert found is not None
    return found


def parts(folder: Path, name: str, text: str = "", profile: str = ARM) -> Mapping[str, str]:
    return graph(folder, name, text=text, profile=profile).node(f"step.{name}").parts


def test_steps_come_last_and_in_the_manifests_order(tmp_path: Path) -> None:
    made = graph(tmp_path, "rail", "arm")
    assert made.names() == (*STAGES, "endpoint", "step.rail", "step.arm")
    node = made.node("step.arm")
    assert (node.kind, node.harness, node.calls_model) == (NodeKind.STEP, "builtin", False)
    assert node.consumes == ("identify", "interface", "serve", "deploy")
    assert node.after == ("endpoint",)


def test_a_stage_that_finds_an_earlier_one_at_fault_has_an_edge_back_to_it(tmp_path: Path) -> None:
    found = {node.name: node.returns for node in graph(tmp_path, "arm").nodes if node.returns}
    assert found == {"interface": "identify", "serve": "interface", "deploy": "serve"}
    assert set(found.values()) == set(BLAMES), "each edge has the findings that send a run back, and nothing else has"


def test_a_run_that_keeps_to_a_step_has_the_endpoint_that_it_needs(tmp_path: Path) -> None:
    made = graph(tmp_path, "rail", "arm")
    assert made.upstream(["step.arm"]) == {*STAGES, "endpoint", "step.arm"}
    assert made.downstream(["endpoint"]) == {"endpoint", "step.rail", "step.arm"}
    assert made.downstream(["step.rail"]) == {"step.rail"}


def test_what_is_in_the_key_of_a_step(tmp_path: Path) -> None:
    arm = parts(tmp_path, "arm")
    assert set(arm) == {"spec", "harness", "model", "profile.so-arm101"}
    assert arm["spec"] == step("arm").spec.digest
    assert parts(tmp_path, "arm", profile=ARM.replace("Six", "Seven"))["profile.so-arm101"] != arm["profile.so-arm101"]
    assert parts(tmp_path, "arm", "harness: {name: command, command: [a]}")["harness"] != arm["harness"]
    more = "scope: intranet\npolicy: {actuate: confirm}\nperception: {camera: usb-0a0a-0002}"
    assert parts(tmp_path, "arm", more) == arm


def test_the_camera_that_the_manifest_names_concerns_the_choice_of_one_alone(tmp_path: Path) -> None:
    assert set(parts(tmp_path, "perceive")) == {"spec", "harness", "model"}  # and of no profile
    named = parts(tmp_path, "perceive", "perception: {camera: usb-0a0a-0002}")
    assert named["setting.perception.camera"] == "usb-0a0a-0002"
    assert parts(tmp_path, "perceive", "perception: {interval: 60s}") == parts(tmp_path, "perceive")


def test_no_other_key_knows_of_steps(tmp_path: Path) -> None:
    def keyed(made: Graph) -> list[Node]:
        return [node for node in made.nodes if node.kind is not NodeKind.STEP]

    assert keyed(graph(tmp_path, "arm", "rail")) == keyed(graph(tmp_path))


def test_a_drawing_shows_what_a_step_is_carried_out_with(tmp_path: Path) -> None:
    made = graph(tmp_path, "arm")
    assert '"step.arm" -> "endpoint" [style = dashed];' in to_dot(made)
    assert "endpoint -.-> step.arm" in to_mermaid(made)
