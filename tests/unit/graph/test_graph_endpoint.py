"""Key parts of the endpoint: scope, network, tunnel, policy and what profiles limit; none of them is a stage's."""

from pathlib import Path

import pytest

from octoform.graph.compile import compile_graph, in_force
from octoform.graph.model import Graph
from octoform.manifest.loader import parse
from octoform.profiles import Profile, load
from octoform.protocol import STAGES, Spec

SPECS = {name: Spec(name, Path(name), "", "", f"sha256:{name}", (), "", None) for name in STAGES}
LAMP = "---\nname: lamp\nabout: lamp\nevidence: {{text: [{word}]}}\n{more}---\n\nIt dims.{prose}\n"


def graph(text: str, *profiles: Profile) -> Graph:
    manifest, found = parse(f"version: 1\n{text}\n".encode(), Path("/project/octopus.yaml"), {})
    assert manifest is not None, found
    return compile_graph(manifest, SPECS, profiles)


def lamp(folder: Path, more: str = "", word: str = "Lamp", prose: str = "") -> Profile:
    path = folder / "lamp.md"
    path.write_text(LAMP.format(word=word, more=more, prose=prose))
    profiles, _ = load([path])
    return profiles[0]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "scope: local",
        "policy: {}",
        "policy: {mode: enforce, irreversible: confirm, timeout: 30s, rules: [], limits: [], result_bytes: 10000000}",
    ],
)
def test_defaults_are_no_parts(text: str) -> None:
    assert graph(text).node("endpoint").parts == {"setting.scope": "local"}


@pytest.mark.parametrize(
    ("text", "parts"),
    [
        ("scope: intranet", {}),
        ("scope: internet\nnetwork: {port: 7777}\ntunnel: {}", {}),
        ("scope: intranet\nnetwork: {port: 1, hosts: [b, a]}", {"network.port": "1", "network.hosts": "b, a"}),
        ("scope: internet\ntunnel: {command: [t, '{url}', a b]}", {"tunnel.command": "t '{url}' 'a b'"}),
        ("policy: {irreversible: allow}", {"policy.irreversible": "allow"}),
        ("policy: {rules: [{tools: [a, b], decision: deny}]}", {"policy.rules[0]": "deny a, b"}),
        (
            "policy: {limits: [{tool: a, rate: 2/1h}, {tool: b, parameter: p, step: 0.5}]}",
            {"policy.limits[0]": "a: rate 2/3600s", "policy.limits[1]": "b p: step 0.5"},
        ),
        ("policy: {timeouts: {b: 1m, 'a*': 2s}}", {"policy.timeouts a*": "2s", "policy.timeouts b": "60s"}),
    ],
)
def test_what_differs_is_a_part_in_the_words_of_the_manifest(text: str, parts: dict[str, str]) -> None:
    found = graph(text)
    assert {name: value for name, value in found.node("endpoint").parts.items() if name != "setting.scope"} == {
        f"setting.{name}": value for name, value in parts.items()
    }
    assert [found.node(stage) for stage in STAGES] == [graph("").node(stage) for stage in STAGES]


def test_every_setting_of_a_limit_moves_the_key() -> None:
    base = {"tool": "a", "parameter": "p", "minimum": "1", "maximum": "9", "step": "2", "cumulative": "5"}
    base |= {"rate": "1/1s", "cooldown": "1s", "quiet_hours": "01:00-02:00"}
    other = {**dict.fromkeys(base, "7"), "tool": "b", "parameter": "q", "minimum": "2"}
    other |= {"rate": "2/1s", "cooldown": "2s", "quiet_hours": "01:00-03:00"}

    def limit(values: dict[str, str]) -> object:
        inside = ", ".join(f"{name}: {value}" for name, value in values.items())
        return graph(f"policy: {{limits: [{{{inside}}}]}}").node("endpoint").parts["setting.policy.limits[0]"]

    texts = [limit(base), *(limit({**base, name: other[name]}) for name in base)]
    assert len(set(texts)) == len(base) + 1


def test_what_a_profile_limits_is_a_part_and_its_prose_is_not(tmp_path: Path) -> None:
    limits, stop = "limits: [{parameter: percent, maximum: 80}]\n", 'stop: [{class: tty, write: "00"}]\n'

    def part(more: str = limits, **other: str) -> str | None:
        return graph("", lamp(tmp_path, more, **other)).node("endpoint").parts.get("profile.lamp limits")

    assert part("") is None
    assert part(prose=" And more.") == part()
    moved = [part(), part(limits.replace("80", "70")), part(stop), part(limits + stop), part(word="Other")]
    moved += [part(stop.replace("00", "01")), part(stop.replace("tty", "tty, baud: 9600"))]
    assert None not in moved
    assert len(set(moved)) == len(moved)


@pytest.mark.parametrize(
    ("part", "scope", "text"),
    [
        ("setting.policy.mode", "local", "enforce"),
        ("setting.policy.rules[0]", None, None),
        ("setting.network.port", None, "7777"),
        ("setting.network.port", "intranet", "7777"),
        ("setting.network.port", "local", None),
        ("setting.tunnel.command", "intranet", None),
        ("setting.tools", None, None),
    ],
)
def test_what_is_in_force_without_a_part(part: str, scope: str | None, text: str | None) -> None:
    assert in_force(part, scope) == text
