"""Key parts of what a person said: IDENTIFY has them as they are; the endpoint only where they can move a limit."""

from pathlib import Path

import pytest

from octoform.graph.compile import compile_graph
from octoform.graph.model import Graph
from octoform.manifest.loader import parse
from octoform.profiles import load_text
from octoform.protocol import STAGES, Spec

SPECS = {name: Spec(name, Path(name), "", "", f"sha256:{name}", (), "", None) for name in STAGES}
SAID = {"answer.usb-1": "the lamp", "answer.usb-2": "in the\noven"}
MANIFEST = b'version: 1\nanswers: {usb-1: the lamp, usb-2: "in the\\noven\\n"}\n'


def graph(more: str = "") -> Graph:
    manifest, found = parse(MANIFEST, Path("/project/octopus.yaml"), {})
    assert manifest is not None, found
    profile, found = load_text(f"---\nname: lamp\nabout: lamp\nevidence: {{text: [lamp]}}\n{more}---\nIt dims.\n", "x")
    assert profile is not None, found
    return compile_graph(manifest, SPECS, (profile,))


def answers_of(one: Graph, node: str) -> dict[str, str]:
    return {part: text for part, text in one.node(node).parts.items() if part.startswith("answer.")}


def test_an_answer_is_of_no_other_stages_concern() -> None:
    found = graph()
    assert answers_of(found, "identify") == SAID
    assert all(answers_of(found, name) == {} for name in (*STAGES, "endpoint") if name != "identify")


@pytest.mark.parametrize("more", ["limits: [{parameter: level, maximum: 9}]\n", 'stop: [{class: tty, write: "00"}]\n'])
def test_the_endpoint_has_it_where_it_can_decide_a_limit_or_a_stop(more: str) -> None:
    assert answers_of(graph(more), "endpoint") == SAID
