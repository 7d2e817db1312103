"""Keys: every part counts, order does not, and only PROBE sees the host."""

from hypothesis import given
from hypothesis import strategies as st

from octoform.graph.model import (
    Graph,
    Node,
    NodeKind,
    input_of,
    key_of,
    key_parts,
    moved_parts,
    renewed,
    to_dot,
    to_mermaid,
)

CHAIN = Graph(
    (
        Node("probe", NodeKind.STAGE, (), {"spec": "s1", "harness": "builtin"}, observes_host=True, harness="builtin"),
        Node(
            "identify",
            NodeKind.STAGE,
            ("probe",),
            {"spec": "s2", "harness": "builtin"},
            harness="builtin",
            returns="probe",
        ),
        Node("endpoint", NodeKind.ENDPOINT, ("identify",)),
    )
)


def test_only_the_node_that_observes_the_host_has_the_hardware_in_its_key() -> None:
    outputs = {"probe": "sha256:aa", "identify": "sha256:bb"}
    assert key_parts(CHAIN.node("probe"), outputs, "sha256:ff")["hardware"] == "sha256:ff"
    assert "hardware" not in key_parts(CHAIN.node("identify"), outputs, "sha256:ff")


def test_a_consumed_output_is_a_part_of_its_own() -> None:
    parts = key_parts(CHAIN.node("identify"), {"probe": "sha256:aa"}, None)
    assert parts == {"spec": "s2", "harness": "builtin", "input.probe": "sha256:aa"}


@given(st.dictionaries(st.text(min_size=1), st.text(), min_size=1, max_size=6), st.data())
def test_a_key_moves_exactly_when_a_part_moves(parts: dict[str, str], data: st.DataObject) -> None:
    shuffled = dict(data.draw(st.permutations(list(parts.items()))))
    assert key_of(shuffled) == key_of(parts)
    name = data.draw(st.sampled_from(sorted(parts)))
    assert key_of({**parts, name: parts[name] + "x"}) != key_of(parts)
    assert key_of({key: value for key, value in parts.items() if key != name}) != key_of(parts)


def test_which_parts_moved_and_which_are_inputs() -> None:
    before, now = {"spec": "s1", "input.probe": "a", "model": "m"}, {"spec": "s2", "input.probe": "a", "answer.x": "y"}
    assert moved_parts(before, now) == ["answer.x", "model", "spec"]
    assert [input_of(part) for part in before] == ["", "probe", ""]


def test_what_was_verified_again_has_the_new_output_where_it_had_the_former_one() -> None:
    parts = {"spec": "old", "model": "", "input.serve": "old", "input.deploy": "older", "input.probe": "old"}
    after = renewed(parts, {"serve": ("old", "new"), "deploy": ("old", "new")})
    assert after == {**parts, "input.serve": "new"}


def test_upstream_and_downstream_follow_the_edges() -> None:
    assert CHAIN.upstream(["identify"]) == {"probe", "identify"}
    assert CHAIN.downstream(["identify"]) == {"identify", "endpoint"}


def test_the_way_back_is_no_input_and_orders_nothing() -> None:
    assert CHAIN.node("identify").needs == ("probe",)
    assert CHAIN.from_to("probe", "endpoint") == ("identify", "endpoint")
    assert CHAIN.from_to("identify", "identify") == ()


def test_drawings_hold_every_node_and_edge() -> None:
    dot, mermaid = to_dot(CHAIN), to_mermaid(CHAIN)
    assert '"identify" -> "probe";' in dot
    assert '"endpoint" [label = "endpoint (octoform)"];' in dot
    assert '"identify" -> "probe" [style = dotted];' in dot
    assert "    probe --> identify\n" in mermaid
    assert "    identify -. findings .-> probe\n" in mermaid
    assert '    probe["probe (builtin)"]\n' in mermaid
