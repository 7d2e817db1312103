"""Scope, network, tunnel and policy as values: defaults, the documented example, what old manifests keep."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.manifest.loader import parse
from octoform.manifest.model import Manifest, Network, Tunnel
from octoform.policy import Limit
from octoform.policy.resolve import Policy, Rule

DOCS = Path(__file__).parents[3] / "docs" / "manifest.md"
LOCAL = "sha256:400ce40b1f3f6379da02d2756531423078e042547f7bd71ad5c151d66e34c5a6"
"""The digest of `version: 1` from before there were other scopes and a policy."""


def loaded(text: str) -> Manifest:
    manifest, found = parse(f"version: 1\n{text}\n".encode(), Path("octopus.yaml"), {})
    assert manifest is not None, found
    return manifest


def test_defaults() -> None:
    manifest = loaded("")
    assert (manifest.scope, manifest.network, manifest.tunnel) == ("local", None, None)
    policy = manifest.policy
    assert policy == Policy()
    assert [policy.decision_for(effect) for effect in ("read", "actuate", "irreversible")] == [
        "allow",
        "confirm",
        "confirm",
    ]
    assert (policy.mode, policy.timeout, policy.result_bytes) == ("enforce", 30, 10_000_000)


@pytest.mark.parametrize(
    "text",
    ["", "scope: local", "policy: {}", "policy: {irreversible: confirm, rules: [], timeouts: {}, timeout: 30s}"],
)
def test_a_manifest_that_changes_nothing_keeps_its_digest(text: str) -> None:
    assert loaded(text).digest == LOCAL


@pytest.mark.parametrize(
    "text", ["scope: intranet", "policy: {irreversible: allow}", "policy: {timeout: 31s}", "policy: {mode: shadow}"]
)
def test_a_change_moves_the_digest(text: str) -> None:
    assert loaded(text).digest != LOCAL


def test_each_scope_has_what_it_uses() -> None:
    near, far = loaded("scope: intranet"), loaded("scope: internet")
    assert (near.network, near.tunnel) == (Network("all", 7777), None)
    command = ("cloudflared", "tunnel", "--no-autoupdate", "--url", "{url}")
    assert (far.network, far.tunnel) == (Network(), Tunnel(command))
    chosen = loaded(
        "scope: internet\nnetwork: {interface: eth0, port: 80, hosts: [b, a]}\ntunnel: {command: ['{url}']}"
    )
    assert chosen.network == Network("eth0", 80, ("b", "a"))
    assert chosen.tunnel == Tunnel(("{url}",))


def test_the_documented_example_says_what_it_seems_to_say() -> None:
    example = next(
        block for block in re.findall(r"```yaml\n(.*?)```", DOCS.read_text(), re.DOTALL) if "limits:" in block
    )
    manifest, found = parse(example.encode(), Path("octopus.yaml"), {})
    assert manifest is not None
    assert found == []
    assert manifest.policy == Policy(
        actuate="allow",
        rules=(Rule(("move_home",), "allow"), Rule(("move_*", "*_torque"), "confirm")),
        limits=(
            Limit("move_*", "steps", minimum=-2000, maximum=2000),
            Limit("move_rail", "steps", cumulative=10000),
            Limit("move_joint", "position", step=500),
            Limit("set_*", rate=(10, 60)),
            Limit("move_joint", cooldown=2),
            Limit("set_fan", quiet_hours=("22:00", "07:00")),
        ),
        timeouts=(("capture_image", 60),),
    )


def test_whole_numbers_stay_whole() -> None:
    (limit,) = loaded("policy: {limits: [{tool: a, parameter: p, minimum: -2, maximum: 1.5}]}").policy.limits
    assert {name: repr(value) for name, value in limit.values.items()} == {"minimum": "-2", "maximum": "1.5"}


@pytest.mark.parametrize(
    ("name", "seconds"),
    [("read_lamp", 7), ("read_lamps", 6), ("read_fan", 5), ("reed_fan", 4), ("move", 3), ("write", 3)],
)
def test_the_most_telling_name_decides_a_timeout(name: str, seconds: int) -> None:
    text = "policy: {timeout: 9s, timeouts: {'*': 3s, 're?d_*': 4s, 'read_*': 5s, 'read_l*': 6s, read_lamp: 7s}}"
    assert loaded(text).policy.timeout_for(name) == seconds
    assert loaded("policy: {timeout: 9s, timeouts: {'x*': 3s}}").policy.timeout_for(name) == 9


def test_of_equal_names_the_shorter_time_decides() -> None:
    assert loaded("policy: {timeouts: {'a*': 3s, '*a': 2s}}").policy.timeout_for("aa") == 2


@given(st.permutations(["a*: 1s", "'*a': 2s", "aa: 3s", "'?a': 4s", "'*': 5s"]), st.text("ab", min_size=1, max_size=3))
def test_timeouts_have_no_order(entries: list[str], name: str) -> None:
    first = loaded("policy: {timeouts: {a*: 1s, '*a': 2s, aa: 3s, '?a': 4s, '*': 5s}}").policy
    assert loaded(f"policy: {{timeouts: {{{', '.join(entries)}}}}}").policy == first
    assert first.timeout_for(name) in range(1, 6)
