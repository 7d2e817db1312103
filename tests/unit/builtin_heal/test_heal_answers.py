"""What the embedded agent does about an error: the action of its class, and code is left to a person."""

import json
from pathlib import Path
from typing import Any

import pytest

from octoform.builtin.heal import answer, run
from octoform.builtin.task import Task, TaskRefused, read_task
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.contracts.report_context import DutyFacts
from octoform.protocol import schema_dir

LAMP = "usb-1234-0001"
TOOL = {"name": "set_lamp", "effect": "actuate", "devices": [LAMP], "input_schema": {"type": "object"}}


def document(kind: str, cites: tuple[str, ...] = ("r1",)) -> dict[str, Any]:
    """The input for an error of a class."""
    error = {"tool": "set_lamp", "device": LAMP, "class": kind, "message": "It fails.", "severity": "recoverable"}
    reading = {"id": "r1", "at": "", "channel": "log", "source": "set_lamp", "path": "/ok", "value": False, "why": ""}
    return {
        "format": 1,
        "host": "bench",
        "target": "tool:set_lamp",
        "error": {**error, "suggested_fix": None, "cites": list(cites)},
        "tool": {"name": "set_lamp"},
        "functions": ["set_lamp"],
        "device": {"id": LAMP, "name": None, "tools": ["set_lamp"]},
        "readings": [reading],
        "failures": [],
        "log": "",
        "server": "server.py",
    }


@pytest.mark.parametrize(
    ("kind", "status", "action"),
    [
        ("dependency", "repaired", "redeploy"),
        ("corrupted_file", "repaired", "restore"),
        ("dead_process", "repaired", "restart"),
        ("device_moved", "repaired", "rediscover"),
        ("broken_tool", "failed", "none"),
        ("none", "not_mine", "none"),
    ],
)
@pytest.mark.parametrize("cites", [("r1",), ("r1", "forgotten"), ()])
def test_each_class_has_its_answer_which_keeps_the_contract(
    kind: str, status: str, action: str, cites: tuple[str, ...]
) -> None:
    given = document(kind, cites)
    report = answer(given)
    known = Artifacts(interface={"tools": [TOOL]}, duty=DutyFacts.of(given))
    assert check("heal", report, known, schema_dir(None)) == []
    if not cites and action != "none":
        status, action = "failed", "none"  # nothing shows that there is anything to mend
    assert (report["status"], report["action"], report["server"], report["claims"]) == (status, action, None, [])


def test_the_duty_writes_its_file_and_says_how_it_went(tmp_path: Path) -> None:
    (tmp_path / "input.json").write_text(json.dumps(document("dependency")))
    task = {"stage": "heal", "input": str(tmp_path / "input.json"), "output": str(tmp_path / "output.json")}
    (tmp_path / "task.json").write_text(json.dumps(task))
    assert run(read_task(tmp_path / "task.json", {})) == "repaired by redeploy"
    assert json.loads((tmp_path / "output.json").read_text())["class"] == "dependency"


def test_an_input_that_is_none_is_refused_with_a_reason(tmp_path: Path) -> None:
    (tmp_path / "input.json").write_text(json.dumps({"error": None}))
    with pytest.raises(TaskRefused, match="input of HEAL"):
        run(Task("heal", tmp_path / "input.json", None, tmp_path / "output.json", 30, tmp_path))
