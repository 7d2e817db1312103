"""What a child that was killed has left in service is settled before anybody looks again."""

from collections.abc import Mapping
from typing import Any

import pytest

from octoform.daemon.model import Done, FaultClass, Finding, Kind, Repair
from octoform.daemon.repair.repairer import Agents, Repairs

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
        return {"ok": False, "detail": "it ended", "again": True, "untold": untold and job != "settle"}

    made = Agents("bench", run, Repairs("bench", run))(FINDING, repair)
    assert isinstance(made, Done) and made.untold is untold and done == jobs
