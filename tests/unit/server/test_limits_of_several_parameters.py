"""A tool that moves several joints at once: each has its own limits, whatever is called and whatever comes of it."""

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.policy import Limit, exact, published
from octoform.policy.enforce import Ledger
from octoform.policy.resolve import Policy, resolve

BOUNDS = {"pan": (-40, 60), "lift": (0, 30), "grip": (-5, 5)}
FARTHEST = {"pan": 100, "lift": 45, "grip": 12}
NUMBER = {"type": "integer"}
TOOLS = [
    {
        "name": name,
        "capability": name,
        "effect": "actuate",
        "devices": ["arm"],
        "input_schema": {"type": "object", "properties": dict.fromkeys(properties, NUMBER)},
        "limits": limits,
    }
    for name, properties, limits in (
        (
            "turn",
            BOUNDS,
            [{"parameter": each, "minimum": low, "maximum": high} for each, (low, high) in BOUNDS.items()],
        ),
        ("home", (), []),
    )
]
NO_NUMBERS = [float("nan"), float("inf"), -float("inf"), True, False, "10", "", None, [1], {"value": 1}, 10**400]


def rules() -> published.Policy:
    """What INTERFACE and manifest give, and sums that begin again at home as a profile's limits do."""
    given = Policy(limits=tuple(Limit("turn", name, cumulative=most) for name, most in FARTHEST.items()))
    document = resolve(given, TOOLS, ())
    for limit in document["tools"]["turn"]["limits"]:
        if limit["kind"] == "cumulative":
            limit["zero"] = "home"
    return published.parse(document)


RULES = rules()


class Arm:
    """Joints that move as ordered, and in part or not at all when a call fails; nothing is too far for them."""

    def __init__(self, path: Path) -> None:
        self._path = path
        path.unlink(missing_ok=True)
        self.at = dict.fromkeys(BOUNDS, Fraction(0))
        self.start()

    def start(self) -> None:
        """Begin with the counts in the file."""
        self.ledger = Ledger(RULES, self._path, lambda: 1.0)

    def call(self, tool: str, arguments: Mapping[str, Any], done: Fraction, well: bool) -> bool:
        """Call a tool of which ``done`` (0 to 1) is done when it does not go well; whether it was let through."""
        if self.ledger.reserve(tool, arguments) is not None:
            return False
        share = Fraction(1) if well else done
        for name in BOUNDS:
            if tool == "home":
                self.at[name] *= 1 - share
            elif name in arguments:
                low, high = BOUNDS[name]
                assert low <= arguments[name] <= high
                self.at[name] += share * exact(arguments[name])
        self.ledger.settle(tool, arguments, well=well)
        return True


STEPS = st.one_of(st.integers(-70, 70), st.sampled_from([0.1, -39.5, "7", True, None, float("nan"), 10**400]))
ARGUMENTS = st.one_of(
    st.fixed_dictionaries({name: st.sampled_from([*ends, 0]) for name, ends in BOUNDS.items()}),
    st.fixed_dictionaries({name: st.integers(*ends) for name, ends in BOUNDS.items()}),
    st.fixed_dictionaries({}, optional=dict.fromkeys(BOUNDS, STEPS)),
)
SHARES = st.sampled_from([Fraction(0), Fraction(1, 3), Fraction(1)])
CALL: st.SearchStrategy[tuple[str, dict[str, int], Fraction, bool]] = st.one_of(
    st.tuples(st.just("turn"), ARGUMENTS, SHARES, st.booleans()),
    st.tuples(st.just("turn"), st.sampled_from([{"pan": 60}, {"lift": 30, "grip": 5}]), SHARES, st.just(True)),
    st.tuples(st.just("turn"), st.sampled_from([{"pan": -40}, {"grip": -5}]), SHARES, st.just(True)),
    st.tuples(st.just("home"), st.just({}), SHARES, st.booleans()),
    st.just(("start", {}, Fraction(0), True)),
)
CALLS = st.lists(st.tuples(CALL, st.integers(1, 5)), max_size=15)
"""Calls, and how often each is made: a bound is reached by going the same way several times."""


@given(CALLS)
def test_whatever_is_called_and_comes_of_it_no_joint_goes_too_far(
    tmp_path_factory: pytest.TempPathFactory, calls: list[tuple[tuple[str, dict[str, Any], Fraction, bool], int]]
) -> None:
    arm = Arm(tmp_path_factory.getbasetemp() / "several.json")
    for tool, arguments, done, well in (call for call, often in calls for _ in range(often)):
        if tool == "start":
            arm.start()
        else:
            arm.call(tool, arguments, done, well)
        assert all(abs(arm.at[name]) <= most for name, most in FARTHEST.items()), arm.at


def test_each_parameter_has_its_own_limit_and_uses_nothing_of_another(tmp_path: Path) -> None:
    ledger = Ledger(RULES, tmp_path / "limits.json", lambda: 1.0)
    assert ledger.reserve("turn", {"pan": 60, "lift": 0, "grip": 5}) is None
    refusal = ledger.reserve("turn", {"pan": 0, "lift": 40, "grip": 6})
    assert refusal is not None and "lift 40 is above" in refusal.text and "grip 6 is above" in refusal.text
    assert ledger.used()["turn"]["sums"] == {"pan since home": 60, "lift since home": 0, "grip since home": 5}
    assert ledger.reserve("turn", {"pan": 40, "lift": 30, "grip": 5}) is None


@pytest.mark.parametrize("name", BOUNDS)
@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_one_value_that_is_no_number_stops_the_whole_call(tmp_path: Path, name: str, value: Any) -> None:
    ledger = Ledger(RULES, tmp_path / "limits.json", lambda: 1.0)
    refusal = ledger.reserve("turn", {**dict.fromkeys(BOUNDS, 1), name: value})
    assert refusal is not None and refusal.code == "no_number"
    assert ledger.used()["turn"]["sums"] == {}


def test_a_way_home_that_fails_may_have_been_gone(tmp_path: Path) -> None:
    """Counted as not gone, the other direction would be open for twice as far."""
    arm = Arm(tmp_path / "limits.json")
    assert arm.call("turn", {"pan": 60}, Fraction(1), well=True) and arm.call("home", {}, Fraction(1), well=False)
    assert not arm.call("turn", {"pan": 41}, Fraction(1), well=True)
    assert arm.call("turn", {"pan": 40}, Fraction(1), well=True)
    arm.start()
    for _ in range(3):
        assert arm.call("turn", {"pan": -40}, Fraction(1), well=True)
    assert not arm.call("turn", {"pan": -40}, Fraction(1), well=True)
    assert arm.at["pan"] == -80
