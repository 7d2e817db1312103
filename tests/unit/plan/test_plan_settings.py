"""A changed scope or policy publishes the endpoint again; no agent runs for it, whatever it was before."""

import itertools
from pathlib import Path

import pytest

from octoform.graph.compile import compile_graph
from octoform.graph.model import Graph, key_parts
from octoform.manifest.loader import parse
from octoform.plan.diff import Observed, Prior, Wishes, diff
from octoform.plan.model import Action, Cause
from octoform.protocol import STAGES, Spec

SPECS = {name: Spec(name, Path(name), "", "", f"sha256:{name}", (), "", None) for name in STAGES}
OUTPUTS = {name: f"sha256:out-{name}" for name in (*STAGES, "endpoint")}
FILES = {name: f"sha256:file-{name}" for name in (*STAGES, "endpoint")}
SEEN = Observed("sha256:host", FILES)
TEXTS = [
    "",
    "scope: intranet",
    "scope: intranet\nnetwork: {port: 8000}",
    "scope: internet\ntunnel: {command: [t, '{url}']}",
    "policy: {mode: dry_run}",
    "policy: {irreversible: allow, rules: [{tools: ['*'], decision: deny}]}",
    "policy: {limits: [{tool: a, rate: 1/1s}]}",
    "policy: {timeout: 5s, timeouts: {a: 6s}, result_bytes: 1000}",
]


def graph(text: str) -> Graph:
    manifest, found = parse(f"version: 1\n{text}\n".encode(), Path("/project/octopus.yaml"), {})
    assert manifest is not None, found
    return compile_graph(manifest, SPECS, ())


def settled(text: str) -> dict[str, Prior]:
    return {
        node.name: Prior("accepted", key_parts(node, OUTPUTS, "sha256:host"), OUTPUTS[node.name], FILES[node.name])
        for node in graph(text).nodes
    }


@pytest.mark.parametrize(("before", "now"), list(itertools.permutations(TEXTS, 2)))
def test_only_the_endpoint_moves_and_no_agent_runs(before: str, now: str) -> None:
    actions = diff(graph(now), settled(before), SEEN, Wishes())
    assert [item.node for item in actions if item.action is not Action.NOOP] == ["endpoint"]
    endpoint = actions[-1]
    assert (endpoint.action, endpoint.certain, endpoint.calls_agent) == (Action.UPDATE, True, False)
    assert {reason.cause for reason in endpoint.reasons} == {Cause.CHANGED}
    assert all((reason.part or "").startswith("setting.") for reason in endpoint.reasons)
    assert all(item.action is Action.NOOP for item in diff(graph(now), settled(now), SEEN, Wishes()))
