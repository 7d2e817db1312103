"""What a child that was killed has left in service is settled before anybody looks again."""

from collections.abc import Mapping
from typing import Any

import pytest

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.daemon.model import FaultClass, Finding, Kind, Repair
from octoform.daemon.repair.playbook import Means, carry_out

FINDING = Finding(Kind.TOOL_FAILING, FaultClass.BROKEN_TOOL, "tool:a", "it fails", ("x",), Repair.HEAL, ())


@pytest.mark.parametrize(
    ("repair", "untold", "jobs"),
    [
        (Repair.HEAL, True, ["heal", "settle"]),
        (Repair.REDISCOVER, True, ["rediscover", "settle"]),
        (Repair.HEAL, False, ["heal"]),
        (Repair.WATCH, True, ["watch"]),
        (Repair.REBUILD, True, ["rebuild"]),
    ],
)
def test_a_child_that_was_killed_leaves_nothing_in_service(repair: Repair, untold: bool, jobs: list[str]) -> None:
    done: list[str] = []

    def run(job: str, brief: Mapping[str, Any], seconds: float) -> Mapping[str, Any]:
        done.append(job)
        assert brief["host"] == "bench" and seconds > 0
        cost = None if untold and job != "settle" else Cost()
        return RepairOutcome.failed("test.end", "it ended", cost=cost).to_json()

    made = carry_out(FINDING, repair, Means("bench", run))
    assert (made.cost is None) is untold and done == jobs
