"""The rail's limits, enforced where the generated server has no say: whatever is called, the hardware stays within.

Profile, interface and policy become the endpoint's policy as they do in an apply; in front of a firmware that moves as
it gets is a server that checks nothing.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rig.rail import DEVICE, FARTHEST, HOT, MOST, Rail

from octoform.policy import Limit, published
from octoform.policy.enforce import Ledger
from octoform.policy.resolve import Policy, resolve
from octoform.profiles import load

(PROFILE,), _ = load([Path(__file__).parents[3] / "profiles" / "camera-rail.md"])
LINES = {"rail_move_x": "MOVE_X {steps}", "rail_move_y": "MOVE_Y {steps}", "rail_home": "HOME"}


def tools(*devices: str) -> list[dict[str, Any]]:
    """The tools as INTERFACE has them, in the hands of a hostile agent: no bound of its own."""
    return [
        {
            "name": name,
            "capability": name,
            "effect": "actuate",
            "devices": list(devices),
            "input_schema": {"type": "object", "properties": {"steps": {"type": "integer"}} if "{" in line else {}},
        }
        for name, line in LINES.items()
    ]


class Endpoint:
    """The limits in front of a server that passes everything on; ``refused`` counts."""

    def __init__(self, folder: Path, given: Policy | None = None, devices: Sequence[str] = (DEVICE,)) -> None:
        document = resolve(given or Policy(), tools(*devices), [(PROFILE, list(devices))])
        self.policy, self._path = published.parse(document), folder / "limits.json"
        self._path.unlink(missing_ok=True)
        self.rail, self.refused = Rail(), 0
        self.start()

    def start(self) -> None:
        """Begin with the counts in the file."""
        self.ledger = Ledger(self.policy, self._path, lambda: 1.0)

    def call(self, tool: str, **arguments: Any) -> str:
        """What the firmware answers, or why the call was refused."""
        refusal = self.ledger.reserve(tool, arguments)
        if refusal is not None:
            self.refused += 1
            return refusal.text
        answer = self.rail.obey(LINES[tool].format(**arguments)) or ""
        self.ledger.settle(tool, arguments, well=answer == "OK")
        return answer


CALLS = st.lists(
    st.one_of(
        st.tuples(st.sampled_from(["rail_move_x", "rail_move_y"]), st.sampled_from([MOST, -MOST, MOST + 1, HOT])),
        st.tuples(st.sampled_from(["rail_move_x", "rail_move_y"]), st.integers(-3 * MOST, 3 * MOST)),
        st.just(("rail_home", None)),
        st.sampled_from([("restart", None), ("jam", None)]),
    ),
    max_size=60,
)


@given(CALLS)
def test_whatever_is_called_the_firmware_stays_within(
    tmp_path_factory: pytest.TempPathFactory, calls: list[tuple[str, int | None]]
) -> None:
    endpoint = Endpoint(tmp_path_factory.getbasetemp())
    for tool, steps in calls:
        if tool == "restart":
            endpoint.start()
        elif tool == "jam":
            endpoint.rail.jammed = not endpoint.rail.jammed
        else:
            endpoint.call(tool, **({} if steps is None else {"steps": steps}))
    assert endpoint.rail.longest <= MOST and endpoint.rail.farthest <= FARTHEST


def test_the_way_back_counts_from_home_and_not_from_before(tmp_path: Path) -> None:
    """Without the return to zero, an axis could go twice as far to the other side after it was driven home."""
    endpoint = Endpoint(tmp_path)
    for _ in range(5):
        assert endpoint.call("rail_move_x", steps=MOST) == "OK"
    assert "since rail_home" in endpoint.call("rail_move_x", steps=1)
    assert endpoint.call("rail_home") == "OK"
    endpoint.start()
    for _ in range(5):
        assert endpoint.call("rail_move_x", steps=-MOST) == "OK"
    assert "Allowed now: 0 to 20000 steps" in endpoint.call("rail_move_x", steps=-1)
    assert endpoint.rail.farthest == FARTHEST and endpoint.refused == 2


def test_moves_that_fail_are_reckoned_with_both_ways(tmp_path: Path) -> None:
    """The firmware reports that it did not move: counted as moved, the way back would be twice as long."""
    endpoint = Endpoint(tmp_path)
    endpoint.rail.jammed = True
    assert endpoint.call("rail_move_x", steps=MOST).startswith("ERR")
    endpoint.rail.jammed = False
    endpoint.start()
    for _ in range(5):
        assert endpoint.call("rail_move_x", steps=-MOST) == "OK"
    found = endpoint.call("rail_move_x", steps=-1)
    assert "it may really be -10000 to -8000 steps now. Allowed now: 0 to 18000 steps." in found
    assert endpoint.rail.farthest == FARTHEST
    endpoint.call("rail_home")
    assert endpoint.call("rail_move_x", steps=-MOST) == "OK"


@pytest.mark.parametrize("steps", [float("nan"), float("inf"), "far", None, True])
def test_a_failed_call_that_no_sum_could_count_changes_nothing(tmp_path: Path, steps: object) -> None:
    endpoint = Endpoint(tmp_path)
    endpoint.ledger.settle("rail_move_x", {"steps": steps}, well=False)
    assert endpoint.call("rail_move_x", steps=MOST) == "OK"


def test_a_home_that_fails_brings_nothing_back(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path)
    for _ in range(5):
        endpoint.call("rail_move_y", steps=MOST)
    endpoint.rail.manner = "odd"
    endpoint.call("rail_home")
    endpoint.rail.manner = "well"
    assert "would bring the sum" in endpoint.call("rail_move_y", steps=1)


def test_a_limit_of_the_manifest_stays_a_sum_of_its_own(tmp_path: Path) -> None:
    """It knows no home, and the profile's does not widen it."""
    endpoint = Endpoint(tmp_path, Policy(limits=(Limit("rail_move_x", "steps", cumulative=3000),)))
    assert endpoint.call("rail_move_x", steps=MOST) == "OK"
    endpoint.call("rail_home")
    assert "policy.limits[0]" in endpoint.call("rail_move_x", steps=MOST)
    used = endpoint.ledger.used()["rail_move_x"]["sums"]
    assert used == {"steps": MOST, "steps since rail_home": 0}


def test_two_rails_behind_one_tool_share_a_sum_that_no_home_resets(tmp_path: Path) -> None:
    endpoint = Endpoint(tmp_path, devices=(DEVICE, f"{DEVICE}-2"))
    for _ in range(5):
        endpoint.call("rail_move_x", steps=MOST)
    endpoint.call("rail_home")
    assert "over all calls to 10001" in endpoint.call("rail_move_x", steps=1)


@pytest.mark.parametrize("zero", [1, ["x"], {}])
def test_a_policy_file_with_a_strange_zero_is_refused(zero: object) -> None:
    document = resolve(Policy(), tools(DEVICE), [(PROFILE, [DEVICE])])
    document["tools"]["rail_move_x"]["limits"][1]["zero"] = zero
    if zero:
        with pytest.raises(published.PolicyInvalid, match="zero"):
            published.parse(document)
