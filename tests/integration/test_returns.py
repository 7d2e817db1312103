"""A stage finds that the one before it is wrong: that one gets the finding and runs again once, within both budgets."""

from pathlib import Path
from typing import Any

import pytest
from projects import Project

PROBLEM = "the board has no sensor of humidity; only its temperature can be read"
OBJECTS: dict[str, Any] = {
    "mutate": [
        [["identify_errors"], [{"device": "hwmon-benchtemp", "capability": "read_temperature", "problem": PROBLEM}]]
    ]
}
ANOTHER = {"mutate": [[["devices", 0, "capabilities", 0, "description"], "Read the temperature of the board."]]}


@pytest.fixture
def project(tmp_path: Path, environments: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.share_environments(environments)
    return made


def ran(project: Project) -> tuple[int, int]:
    stages = project.stages_run()
    return stages.count("identify"), stages.count("interface")


def test_identify_is_told_and_runs_again(project: Project) -> None:
    project.script = {"identify": ["good"], "identify:told": [ANOTHER], "interface": [OBJECTS, "good"]}
    done = project.apply("-target", "interface", status=0)
    assert project.stages_run()[-4:] == ["identify", "interface", "identify", "interface"]
    assert "what was identified is at fault; IDENTIFY gets the findings and runs again" in done.text
    prompt = (project.attempts("identify")[-1] / "prompt.md").read_text()
    assert PROBLEM in prompt and "INTERFACE-IDENTIFY-WRONG" in prompt
    assert "Read the temperature of the board." in (project.state / "identify" / "output.json").read_text()
    assert {name: node["status"] for name, node in project.nodes().items()}["interface"] == "accepted"
    assert done.events()[-1]["result"]["failed"] is None


def test_who_always_objects_has_one_return_and_the_person_is_told_what_to_do(project: Project) -> None:
    project.script = {"interface": [OBJECTS]}
    done = project.apply("-target", "interface", status=1)
    assert ran(project) == (2, 2)
    assert "INTERFACE-IDENTIFY-WRONG" in done.text and "octoform apply -replace identify" in done.text
    assert project.nodes()["identify"]["status"] == "accepted"

    before = ran(project)
    project.apply("-target", "interface", status=1)
    assert ran(project) == (before[0], before[1] + 1), (
        "what an earlier run identified is only remade when a plan says so"
    )


@pytest.mark.parametrize("stage", ["identify", "interface"])
def test_a_return_has_the_budget_of_one_run(project: Project, stage: str) -> None:
    project.script = {"interface": [OBJECTS, "good"]}
    project.manifest = {"stages": f"{{{stage}: {{budget: {{attempts: 1}}}}}}"}
    done = project.apply("-target", "interface", status=1)
    assert ran(project) == (1, 1)
    assert f"the budget of {stage} has nothing left to fix it with" in done.text


def test_a_device_that_identify_does_not_have_is_no_objection(project: Project) -> None:
    unknown = {"mutate": [[["identify_errors"], [{"device": "usb-dead-beef", "problem": PROBLEM}]]]}
    project.script = {"interface": [unknown, "good"]}
    done = project.apply("-target", "interface", status=0)
    assert ran(project) == (1, 2)
    assert "INTERFACE-UNKNOWN-DEVICE" in done.text


NO_UNIT = "the board tells no unit of its temperature"
GOOD_SERVER = (Path(__file__).parents[1] / "agent" / "good" / "server.py").read_text()
REFUSES = {
    "write": GOOD_SERVER.replace(
        "\n# ///\n\n",
        f'\n# [[tool.octoform.interface-errors]]\n# tool = "read_temperature"\n# problem = "{NO_UNIT}"\n# ///\n\n',
        1,
    )
}
OTHER_TOOLS = {"mutate": [[["tools", 0, "description"], "Read the temperature of the board, in degrees Celsius."]]}


def test_interface_is_told_by_serve_and_runs_again(project: Project) -> None:
    assert NO_UNIT in REFUSES["write"]
    project.script = {"interface": ["good"], "interface:told": [OTHER_TOOLS], "serve": [REFUSES, "good"]}
    done = project.apply("-target", "serve", status=0)
    assert project.stages_run()[-4:] == ["interface", "serve", "interface", "serve"]
    assert "the interface is at fault; INTERFACE gets the findings and runs again" in done.text
    prompt = (project.attempts("interface")[-1] / "prompt.md").read_text()
    assert NO_UNIT in prompt and "SERVE-INTERFACE-WRONG" in prompt
    assert "in degrees Celsius" in (project.state / "interface" / "output.json").read_text()
    assert done.events()[-1]["result"]["failed"] is None


def test_serve_has_one_return_and_the_person_is_told_what_to_do(project: Project) -> None:
    project.script = {"serve": [REFUSES]}
    done = project.apply("-target", "serve", status=1)
    assert [project.stages_run().count(stage) for stage in ("interface", "serve")] == [2, 2]
    assert "SERVE-INTERFACE-WRONG" in done.text and "octoform apply -replace interface" in done.text


def test_what_stands_on_an_interface_that_is_made_again_runs_again(project: Project) -> None:
    """The interface that SERVE sent back objects in its turn: IDENTIFY, INTERFACE and SERVE run once more."""
    project.script = {
        "identify": ["good"],
        "interface:told": [OBJECTS],
        "identify:told": [ANOTHER],
        "serve": [REFUSES, "good"],
    }
    done = project.apply("-target", "serve", status=0)
    assert project.stages_run()[-5:] == ["serve", "interface", "identify", "interface", "serve"]
    assert done.events()[-1]["result"]["failed"] is None
