"""From policy, profiles and INTERFACE to what the endpoint enforces: who decides, which limit is in force, whose."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.endpoint.policy_check import doubts
from octoform.policy import Limit
from octoform.policy import published as launcher
from octoform.policy.enforce import Ledger
from octoform.policy.resolve import Policy, Rule, resolve
from octoform.profiles import Profile
from octoform.profiles.match_rule import Rule as Evidence
from octoform.profiles.model import Stop


def tool(name: str = "move_joint", effect: str = "actuate", **more: Any) -> dict[str, Any]:
    properties = more.pop("properties", {"position": {"type": "integer"}, "joint": {"type": "string"}})
    schema = {"type": "object", "properties": properties}
    return {"name": name, "capability": name, "effect": effect, "devices": ["arm"], "input_schema": schema, **more}


def profile(name: str, *limits: dict[str, Any], stop: tuple[Stop, ...] = ()) -> Profile:
    return Profile(name, name, Path(name), "", "", "sha256:0", Evidence("text", words=("x",)), limits, stop)


def resolved(policy: Policy, *tools: dict[str, Any], holding: Any = ()) -> dict[str, Any]:
    """As `resolve`, once the launcher has read it without a complaint."""
    found = resolve(policy, tools, holding)
    launcher.parse(found)
    return found


def limits(policy: Policy, one: dict[str, Any], holding: Any = ()) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = resolved(policy, one, holding=holding)["tools"][one["name"]]["limits"]
    return found


def test_a_tool_without_any_limit() -> None:
    found = resolved(Policy(), tool(devices=["b", "a"]))
    assert found == {
        "format": 1,
        "mode": "enforce",
        "tools": {
            "move_joint": {
                "effect": "actuate",
                "decision": "confirm",
                "source": "default for actuate tools",
                "timeout": 30.0,
                "result_bytes": 10_000_000,
                "buses": ["a", "b"],
                "limits": [],
            }
        },
        "stop": [],
    }


@pytest.mark.parametrize(
    ("policy", "effect", "decision", "source"),
    [
        (Policy(), "read", "allow", "default for read tools"),
        (Policy(), "actuate", "confirm", "default for actuate tools"),
        (Policy(actuate="allow"), "actuate", "allow", "policy.actuate"),
        (Policy(), "irreversible", "confirm", "default for irreversible tools"),
        (Policy(irreversible="allow"), "irreversible", "allow", "policy.irreversible"),
        (Policy(read="deny"), "read", "deny", "policy.read"),
        (Policy(rules=(Rule(("x",), "deny"),)), "read", "allow", "default for read tools"),
        (Policy(rules=(Rule(("x",), "deny"), Rule(("y", "move_*"), "confirm"))), "read", "confirm", "policy.rules[1]"),
        (
            Policy(rules=(Rule(("move_joint",), "allow"), Rule(("*",), "deny"))),
            "irreversible",
            "allow",
            "policy.rules[0]",
        ),
        (Policy(rules=(Rule(("*",), "deny"), Rule(("move_joint",), "allow"))), "read", "deny", "policy.rules[0]"),
        (Policy(rules=(Rule(("MOVE_*",), "deny"),)), "actuate", "confirm", "default for actuate tools"),
    ],
)
def test_the_first_rule_decides_and_else_the_effect(policy: Policy, effect: str, decision: str, source: str) -> None:
    found = resolved(policy, tool(effect=effect))["tools"]["move_joint"]
    assert (found["decision"], found["source"]) == (decision, source)


def test_mode_times_and_sizes() -> None:
    policy = Policy(mode="shadow", timeout=9, timeouts=(("move_*", 5),), result_bytes=1000)
    found = resolved(policy, tool(), tool("look"))
    assert found["mode"] == "shadow"
    assert [(item["timeout"], item["result_bytes"]) for item in found["tools"].values()] == [(5.0, 1000), (9.0, 1000)]


def test_the_tighter_end_wins_and_each_end_is_named() -> None:
    one = tool(limits=[{"parameter": "position", "minimum": 0, "maximum": 4095, "unit": "raw"}])
    arm = profile("arm", {"parameter": "position", "minimum": 0, "maximum": 4095, "unit": "raw"})
    held = [(arm, {"arm"})]
    interface = {"kind": "range", "parameter": "position", "minimum": 0, "maximum": 4095, "unit": "raw"}
    assert limits(Policy(), one) == [{**interface, "source": "the interface of the tool"}]
    assert limits(Policy(), one, held) == [{**interface, "source": "profile arm"}]
    own = Policy(limits=(Limit("move_*", "position", maximum=3000),))
    assert limits(own, one, held) == [
        {**interface, "maximum": 3000, "source": "profile arm (minimum), policy.limits[0] (maximum)"}
    ]
    wider = Policy(limits=(Limit("move_*", "position", minimum=-9, maximum=9000),))
    assert limits(wider, one, held) == limits(Policy(), one, held)
    both = Policy(limits=(Limit("x", "position", maximum=1), Limit("*", "position", minimum=5, maximum=6)))
    assert limits(both, one, held) == [{**interface, "minimum": 5, "maximum": 6, "source": "policy.limits[1]"}]


def test_a_profile_binds_only_the_tools_of_its_devices() -> None:
    bound: dict[str, Any] = {"parameter": "position", "maximum": 5}
    for limit, devices, concerned in [
        (bound, ["arm"], True),
        (bound, ["arm", "other"], True),
        (bound, ["other"], False),
        ({**bound, "tool": "move_joint"}, ["arm"], True),
        ({**bound, "tool": "move_*"}, ["arm"], True),
        ({**bound, "tool": "shift"}, ["arm"], True),
        ({**bound, "tool": "turn"}, ["arm"], False),
        ({**bound, "parameter": "speed"}, ["arm"], False),
        ({"tool": "move_joint", "parameter": "speed", "maximum": 1, "rate": "1/1s"}, ["arm"], False),
        ({"tool": "shift", "rate": "1/1s"}, ["arm"], True),
    ]:
        one = tool(devices=devices, capability="shift")
        assert bool(limits(Policy(), one, [(profile("arm", limit), {"arm"})])) is concerned, limit


def test_steps_sums_rates_pauses_and_hours() -> None:
    arm = profile(
        "arm",
        {"parameter": "position", "step": 300, "cumulative": 9000, "unit": "raw"},
        {"tool": "move_joint", "rate": "10/1m", "cooldown": "1s", "quiet_hours": "22:00-07:00"},
    )
    policy = Policy(
        limits=(
            Limit("*", "position", step=500, cumulative=50.5),
            Limit("*", rate=(100, 3600)),
            Limit("*", rate=(20, 60)),
            Limit("*", rate=(10, 60)),
            Limit("*", cooldown=2),
            Limit("*", quiet_hours=("12:00", "13:00")),
            Limit("*", quiet_hours=("22:00", "07:00")),
        )
    )
    position = {"type": "integer", "default": 2048}
    found = limits(policy, tool(properties={"position": position}), [(arm, {"arm"})])
    of_position = {"parameter": "position", "unit": "raw", "default": 2048}
    assert found == [
        {"kind": "step", **of_position, "most": 300, "source": "profile arm"},
        {"kind": "cumulative", **of_position, "most": 50.5, "source": "policy.limits[0]"},
        {"kind": "rate", "calls": 10, "seconds": 60.0, "source": "profile arm"},
        {"kind": "rate", "calls": 100, "seconds": 3600.0, "source": "policy.limits[1]"},
        {"kind": "cooldown", "seconds": 2.0, "source": "policy.limits[4]"},
        {"kind": "quiet_hours", "from": "22:00", "to": "07:00", "source": "profile arm"},
        {"kind": "quiet_hours", "from": "12:00", "to": "13:00", "source": "policy.limits[5]"},
    ]


def test_stop_actions_are_for_every_device_the_profile_holds_for() -> None:
    stop = (Stop("tty", 9600, b"\xff\x00"), Stop("hidraw", None, b"\x01"))
    held = [(profile("arm", stop=stop), {"b", "a"}), (profile("lamp"), {"a"}), (profile("rail", stop=stop), set())]
    assert resolved(Policy(), holding=held)["stop"] == [
        {"device": "a", "class": "tty", "baud": 9600, "write": "ff00", "source": "profile arm"},
        {"device": "a", "class": "hidraw", "write": "01", "source": "profile arm"},
        {"device": "b", "class": "tty", "baud": 9600, "write": "ff00", "source": "profile arm"},
        {"device": "b", "class": "hidraw", "write": "01", "source": "profile arm"},
    ]


numbers = st.integers(-20, 20) | st.floats(-20, 20)
bounds = st.fixed_dictionaries({}, optional={"minimum": numbers, "maximum": numbers}).filter(bool)


def passes(value: float, bound: dict[str, float]) -> bool:
    low, high = bound.get("minimum"), bound.get("maximum")
    return (low is None or low <= value) and (high is None or value <= high)


@given(st.lists(bounds, max_size=3), st.lists(bounds, max_size=3), bounds | st.none(), st.lists(numbers, max_size=20))
def test_what_passes_is_what_every_source_lets_pass(
    of_profiles: list[dict[str, float]],
    of_policy: list[dict[str, Any]],
    of_interface: dict[str, float] | None,
    tried: list[float],
) -> None:
    own = [of_interface] if of_interface is not None else []
    one = tool(limits=[{"parameter": "position", **item} for item in own])
    held = [(profile(f"p{at}", {"parameter": "position", **item}), {"arm"}) for at, item in enumerate(of_profiles)]
    policy = Policy(limits=tuple(Limit("*", "position", **item) for item in of_policy))
    sources = [*of_profiles, *of_policy, *own]
    found = limits(policy, one, held)
    assert len(found) == bool(sources)
    edges = [value for item in sources for value in item.values()]
    for value in [*tried, *edges, *(edge + 1e-9 for edge in edges), *(edge - 1e-9 for edge in edges)]:
        assert passes(value, found[0] if found else {}) == all(passes(value, item) for item in sources)


rates = st.tuples(st.integers(1, 5), st.integers(1, 5))


@given(st.lists(rates, max_size=5), st.lists(st.integers(1, 9), max_size=4), st.lists(st.floats(0.1, 9), max_size=4))
def test_paces_are_never_wider_than_any_source(
    given_rates: list[tuple[int, int]], pauses: list[int], steps: list[float]
) -> None:
    found = limits(
        Policy(
            limits=(
                *(Limit("*", rate=rate) for rate in given_rates),
                *(Limit("*", cooldown=pause) for pause in pauses),
                *(Limit("*", "position", step=step) for step in steps),
            )
        ),
        tool(),
    )
    kept = [(item["calls"], item["seconds"]) for item in found if item["kind"] == "rate"]
    for calls, seconds in given_rates:
        assert any(fewer <= calls and longer >= seconds for fewer, longer in kept)
    assert set(kept) <= set(given_rates)
    assert [item["seconds"] for item in found if item["kind"] == "cooldown"] == ([max(pauses)] if pauses else [])
    assert [item["most"] for item in found if item["kind"] == "step"] == ([min(steps)] if steps else [])


def told(policy: Policy, *tools: dict[str, Any], holding: Any = ()) -> list[tuple[str, str, str | None]]:
    return [(item.code, item.summary, item.hint) for item in doubts(policy, tools, holding)]


def test_nothing_is_told_of_a_policy_that_fits() -> None:
    arm = profile("arm", {"parameter": "position", "maximum": 9}, {"tool": "move_*", "rate": "1/1s"})
    policy = Policy(
        rules=(Rule(("*",), "deny"),),
        limits=(Limit("move_joint", "position", minimum=1), Limit("*", "joint", step=1)),
        timeouts=(("move_*", 3),),
    )
    assert told(policy, tool(), tool("look", properties={}), holding=[(arm, {"arm"})]) == []
    assert told(Policy(), holding=[(arm, {"arm"})]) == []
    assert told(Policy(), tool(devices=["other"], properties={}), holding=[(arm, {"arm"})]) == []


def test_what_concerns_nothing_is_told() -> None:
    arm = profile("arm", {"tool": "turn", "parameter": "position", "maximum": 9}, {"parameter": "angle", "step": 1})
    policy = Policy(
        rules=(Rule(("move_joint", "move_jiont"), "deny"),),
        limits=(Limit("fan_*", rate=(1, 1)), Limit("move_*", "positon", step=1), Limit("*", "speed", step=1)),
        timeouts=(("capture", 3),),
    )
    code = "POLICY-UNMATCHED"
    assert told(policy, tool(), holding=[(arm, {"arm"})]) == [
        (code, "policy.rules[0] has no effect: no tool is called move_jiont", "did you mean move_joint?"),
        (code, "policy.limits[0] has no effect: no tool is called fan_*", "the tools are move_joint"),
        (
            code,
            "policy.limits[1] has no effect: move_joint has no parameter positon",
            "did you mean position?",
        ),
        (code, "policy.limits[2] has no effect: move_joint has no parameter speed", "they have position, joint"),
        (code, "policy.timeouts has no effect: no tool is called capture", "the tools are move_joint"),
        (code, "a limit of the profile arm has no effect: no tool is called turn", "the tools are move_joint"),
        (
            code,
            "a limit of the profile arm has no effect: move_joint has no parameter angle",
            "they have position, joint",
        ),
    ]


def test_limits_that_leave_nothing_are_told() -> None:
    lamp = profile("lamp", {"parameter": "position", "maximum": 80})
    policy = Policy(limits=(Limit("*", "position", minimum=90),))
    assert told(policy, tool(), holding=[(lamp, {"arm"})]) == [
        (
            "POLICY-CONTRADICTION",
            "move_joint will refuse every value of position: "
            "at least 90 (policy.limits[0]) and at most 80 (profile lamp)",
            "change one of the two",
        )
    ]


def test_resolving_is_light() -> None:
    code = (
        "import sys, octoform.endpoint.policy_check; "
        "print([name for name in ('pydantic', 'ruamel.yaml', 'fastmcp', 'jsonschema') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


POSITION = {"type": "integer", "minimum": 0, "maximum": 4095}
NAMES = {"pan": ["1"], "elbow": ["3"]}
GOAL = {"of": "position", "unit": "raw", "minimum": 0, "maximum": 4095}
ONE = tool(
    "move_joint",
    properties={"joint": {"type": "string"}, "position": POSITION},
    units={"names": NAMES, "parameter": "joint", "goal": {**GOAL, "parameter": "position"}},
)
ALL = tool(
    "move_joints",
    properties={"pan": POSITION, "elbow": POSITION},
    units={"names": NAMES, "parameters": {"pan": "pan", "elbow": "elbow"}, "goal": GOAL},
)
POSE = tool("home", properties={}, units={"names": NAMES, "goal": {**GOAL, "fixed": {"pan": 2048, "elbow": 1100}}})
SCALED = tool("move_percent", properties={}, units={"names": NAMES, "parameter": "joint", "goal": GOAL})
TORQUE = tool("torque", properties={}, units={"names": NAMES, "parameter": "joint"})
ARM = (ONE, ALL, POSE, SCALED, TORQUE)


@pytest.mark.parametrize(
    "limit",
    [
        Limit("move_joints", "elbow", maximum=1000),
        Limit("move_joint", "position", maximum=1000, units=("elbow",)),
        Limit("*", "position", maximum=1000, units=("elbow",)),
    ],
    ids=["of the parameter of one tool", "of one unit", "of one unit in every tool"],
)
def test_a_range_of_one_unit_is_kept_by_every_tool_that_moves_it(limit: Limit, tmp_path: Path) -> None:
    whole = resolved(Policy(limits=(limit,)), *ARM)
    ledger = Ledger(launcher.parse(whole), tmp_path / "limits.json")

    def passes(name: str, **given: object) -> bool:
        return ledger.judge(name, given) is None

    assert passes("move_joint", joint="elbow", position=1000) and not passes("move_joint", joint="elbow", position=1001)
    assert not passes("move_joint", joint="3", position=2000) and passes("move_joint", joint="pan", position=2000)
    assert passes("move_joints", pan=4000, elbow=1000) and not passes("move_joints", pan=4000, elbow=1001)
    assert not passes("home") and not passes("move_percent", joint="elbow", percent=1)
    assert passes("move_percent", joint="pan", percent=1) and passes("torque", joint="elbow", on=True)
    assert [code for code, _, _ in told(Policy(limits=(limit,)), *ARM)] == ["POLICY-POSE", "POLICY-UNREPORTED"]


def test_what_the_device_reports_is_held_against_the_range_that_every_tool_keeps() -> None:
    limit = Limit("move_joint", "position", maximum=1000, units=("elbow",))
    reports = {"field": "position", "unit": "joint"}
    telling = tuple({**each, "units": {**each["units"], "reports": reports}} for each in (ONE, ALL, SCALED))
    whole = resolved(Policy(limits=(limit,)), *telling, TORQUE)["tools"]
    place = {"kind": "goal", "of": "elbow", "maximum": 1000, "unit": "raw"}
    for name in ("move_joint", "move_joints", "move_percent"):
        (found,) = whole[name]["places"]
        assert {**found, "source": ""} == {**place, "source": ""} and "policy.limits[0]" in found["source"]
    assert "places" not in whole["torque"]
    assert told(Policy(limits=(limit,)), *telling, TORQUE) == []
    ((code, text, _),) = told(Policy(limits=(limit,)), ONE, *telling[1:])
    assert code == "POLICY-UNREPORTED" and "move_joint:" in text
    assert told(Policy(), *ARM) == []


def test_a_range_that_every_tool_keeps_anyway_adds_nothing() -> None:
    wide = profile("so", {"parameter": "position", "minimum": 0, "maximum": 4095})
    whole = resolved(Policy(), *ARM, holding=[(wide, {"arm"})])
    assert [item["kind"] for each in whole["tools"].values() for item in each["limits"]] == ["range"]


def test_a_unit_that_no_tool_has_is_told() -> None:
    ((code, summary, hint),) = told(Policy(limits=(Limit("*", "position", maximum=9, units=("elbov",)),)), *ARM)
    assert code == "POLICY-UNMATCHED" and "elbov" in summary and hint == "did you mean elbow?"


def test_a_limit_below_a_default_is_told_and_its_refusal_names_both(tmp_path: Path) -> None:
    speed = {"type": "integer", "minimum": 50, "maximum": 1500, "default": 400}
    policy, one = Policy(limits=(Limit("*", "speed", maximum=300),)), tool("home", properties={"speed": speed})
    ((code, summary, _),) = told(policy, one)
    assert code == "POLICY-DEFAULT" and all(word in summary for word in ("home", "speed", "400", "300", "limits[0]"))
    refusal = Ledger(launcher.parse(resolved(policy, one)), tmp_path / "limits.json").judge("home", {"speed": 400})
    assert refusal is not None and "300" in refusal.text and "400 is its default" in refusal.text
    given = Ledger(launcher.parse(resolved(policy, one)), tmp_path / "limits.json").judge("home", {"speed": 500})
    assert given is not None and "default" not in given.text
    assert told(Policy(limits=(Limit("*", "speed", maximum=400),)), one) == []


@pytest.mark.parametrize("policy", [Policy(), Policy(actuate="confirm")])
def test_nobody_is_asked_before_something_stops(policy: Policy) -> None:
    found = resolved(policy, tool(effect="actuate", stops=True))["tools"]["move_joint"]
    assert (found["decision"], found["source"]) == ("allow", "what stops a movement waits for no one")


def test_a_person_may_deny_what_stops() -> None:
    found = resolved(Policy(actuate="deny"), tool(effect="actuate", stops=True))
    assert found["tools"]["move_joint"]["decision"] == "deny"
