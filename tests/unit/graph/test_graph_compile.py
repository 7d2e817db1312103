"""Key parts of a manifest's agents: what changes the maker is in them, how and at whose expense it works is not."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from octoform.graph.compile import compile_graph
from octoform.graph.model import Node
from octoform.manifest.loader import load
from octoform.protocol import STAGES, Spec

SPECS = {name: Spec(name, Path(name), "", "", f"sha256:{name}", (), "", None) for name in STAGES}


def node(folder: Path, text: str, stage: str = "identify") -> Node:
    folder.mkdir(exist_ok=True)
    (folder / "bench").mkdir(exist_ok=True)
    (folder / "octopus.yaml").write_text(f"version: 1\nmodel: vendor/name\n{text}\n", "utf-8")
    manifest, found = load(folder / "octopus.yaml", {"V": "1"})
    assert manifest is not None, found
    return compile_graph(manifest, SPECS, ()).node(stage)


def parts(folder: Path, text: str) -> Mapping[str, str]:
    return node(folder, text).parts


@pytest.mark.parametrize(
    ("harness", "part"),
    [
        ("builtin", "builtin"),
        ("{name: command, command: [my-agent]}", "command 88407bbe3ebf"),
        ("pi", "pi"),
        ("{name: pi, command: [/opt/pi], env: [A], key: K, api: openai-completions, sandbox: true}", "pi"),
        ("{name: pi, base_url: 'http://127.0.0.1:${V}'}", "pi"),
        ("{name: codex, web_search: false}", "codex"),
        ("{name: codex, web_search: true}", "codex web_search"),
        ("{name: replay, recording: ./bench/}", "replay bench"),
    ],
)
def test_the_harness_in_a_key_is_what_makes_the_output(tmp_path: Path, harness: str, part: str) -> None:
    assert parts(tmp_path / "one", f"harness: {harness}")["harness"] == part
    assert parts(tmp_path / "two", f"harness: {harness}")["harness"] == part


def test_a_sandbox_around_a_command_is_in_no_key(tmp_path: Path) -> None:
    plain = parts(tmp_path, "harness: {name: command, command: [my-agent]}")
    assert parts(tmp_path, "harness: {name: command, command: [my-agent], sandbox: true}") == plain


def test_budgets_prices_and_housekeeping_are_in_no_key(tmp_path: Path) -> None:
    more = (
        "budget: {turns: 5, usd: 1, idle_timeout: 5s, edit_specs: false}\nhousekeeping: {model: ollama/x}\n"
        "prices: {vendor/name: {input: 1, output: 1}}\nstages: {identify: {budget: {usd: 1, turns: 2}}}"
    )
    assert parts(tmp_path, f"harness: pi\n{more}") == parts(tmp_path, "harness: pi")


def test_the_agent_that_gets_the_rest_is_in_the_key_only_where_there_is_one(tmp_path: Path) -> None:
    plain = parts(tmp_path, "")
    assert plain == {"spec": "sha256:identify", "harness": "builtin", "model": ""}
    second = parts(tmp_path, "stages: {identify: {escalate: {harness: {name: codex, web_search: true}}}}")
    assert second == {**plain, "escalate.harness": "codex web_search", "escalate.model": "vendor/name"}
    recorded = parts(tmp_path, "stages: {identify: {escalate: {harness: {name: replay, recording: bench}}}}")
    assert recorded == {**plain, "escalate.harness": "replay bench", "escalate.model": ""}


@pytest.mark.parametrize(
    ("text", "calls"),
    [
        ("harness: builtin", False),
        ("harness: {name: replay, recording: bench}", False),
        ("harness: {name: command, command: [my-agent]}", True),
        ("harness: litellm", True),
        ("harness: opencode", True),
        ("stages: {identify: {escalate: {harness: pi}}}", True),
        ("stages: {identify: {escalate: {harness: {name: replay, recording: bench}}}}", False),
        ("stages: {probe: {harness: pi}}", False),
    ],
)
def test_which_agents_call_a_model(tmp_path: Path, text: str, calls: bool) -> None:
    assert node(tmp_path, text).calls_model == calls
    assert not node(tmp_path, text, "endpoint").calls_model
