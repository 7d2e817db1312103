"""Servers that must not be served: each bad one is an attempt of one run, refused by name; then a good one goes live.

One project and one test for all of them, because each apply costs seconds; the serving environment is one that all
tests have.
"""

import json
from pathlib import Path
from typing import Any

import pytest
from projects import Done, Project

GOOD = (Path(__file__).parents[1] / "agent" / "good" / "server.py").read_text()
READS = "return Temperature(celsius=round(value / 1000, digits))"


def changed(before: str, after: str) -> str:
    assert before in GOOD
    return GOOD.replace(before, after)


BAD = {
    "syntax error": GOOD + "\n\ndef broken(:\n",
    "omitted tool": changed("def read_temperature(", "def read_humidity("),
    "device opened at import": changed(
        'mcp = FastMCP("bench")', 'mcp = FastMCP("bench")\nHELD = open("/dev/null", "rb")'
    ),
    "device opened by a library at import": changed(
        'mcp = FastMCP("bench")',
        'mcp = FastMCP("bench")\n\n\ndef first() -> bytes:\n    from pathlib import Path\n\n'
        '    return Path("/").joinpath(*"dev video9".split()).read_bytes()\n\n\nSEEN = first()',
    ),
    "import that hangs": changed(
        "\nmcp = FastMCP", '\nimport time\n\nwhile not hasattr(FastMCP, "never"):\n    time.sleep(1)\nmcp = FastMCP'
    ),
    "dead library": changed(
        READS, "import time\n\n        return Temperature(celsius=time.no_such_clock(value, digits))"
    ),
}
REFUSED = {
    "syntax error": {"SERVE-SYNTAX"},
    "omitted tool": {"SERVE-TOOLS-DIFFER"},
    "device opened at import": {"SERVE-DEVICE-AT-IMPORT"},
    "device opened by a library at import": {"ENDPOINT-IMPORT-DEVICE", "SERVE-DEVICE-AT-IMPORT"},
    "import that hangs": {"ENDPOINT-IMPORT-TIMEOUT"},
}


def refusals(done: Done, stage: str) -> list[set[str]]:
    """The codes of each refused attempt of a stage, in order."""
    events = [event for event in done.events() if event["type"] == "attempt_errored" and event["node"] == stage]
    return [{item["code"] for item in event["diagnostics"]} for event in events]


@pytest.fixture
def project(tmp_path: Path, environments: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.share_environments(environments)
    made.write()
    return made


def write(project: Project) -> None:
    """A manifest and a script in which each bad server is one attempt, and DEPLOY first reports that it failed."""
    attempts: list[Any] = []
    for name, text in BAD.items():
        path = project.outside / f"{name}.py"
        path.write_text(text)
        attempts.append({"copy": str(path)})
    failed = [[["status"], "error"], [["error"], "no compiler here"]]
    project.script = {"serve": attempts, "deploy": [{"mutate": failed}, "good"]}
    project.manifest = {
        "budget": "{attempt_timeout: 10s}",
        "stages": f"{{serve: {{budget: {{attempts: {len(BAD) + 1}}}}}, deploy: {{budget: {{attempts: 4}}}}}}",
    }


def test_f05_f06_f08c_servers_that_must_not_be_served_are_refused_by_name_and_a_good_one_goes_live(
    project: Project,
) -> None:
    write(project)
    done = project.apply(status=0)
    found = dict(zip(REFUSED, refusals(done, "serve"), strict=True))
    assert {name: codes for name, codes in found.items() if not codes & REFUSED[name]} == {}

    # The dead library imports well; only a call of the tool shows it, and no set of packages mends it.
    said_error, dead = refusals(done, "deploy")
    assert "DEPLOY-STATUS-ERROR" in said_error
    assert "ENDPOINT-TOOL-BROKEN" in dead
    assert "no_such_clock" in done.out
    assert project.stages_run()[-4:] == ["deploy", "deploy", "serve", "deploy"]

    # So SERVE got the finding, with its own server to correct, and the run went on to its end.
    last = project.attempts("serve")[-1]
    assert "no_such_clock" in (last / "former-server.py").read_text()
    prompt = (last / "prompt.md").read_text()
    assert "ENDPOINT-TOOL-BROKEN" in prompt and "A copy of it is former-server.py" in prompt
    assert (project.state / "serve" / "server.py").read_text() == GOOD
    result = json.loads(done.out.splitlines()[-1])["result"]
    assert result["endpoint"]["tools"] == ["read_temperature"]
    assert (result["added"], result["changed"], result["failed"]) == (6, 0, None)


def test_a_server_that_is_never_mended_ends_the_run(project: Project) -> None:
    path = project.outside / "dead.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(BAD["dead library"])
    project.script = {"serve": [{"copy": str(path)}], "serve:told": [{"copy": str(path)}]}
    done = project.apply(status=1)
    assert project.stages_run().count("serve") == 3, "once, and twice sent back"
    assert project.stages_run().count("deploy") == 3
    assert done.events()[-1]["result"]["failed"] == "deploy"
    assert project.nodes()["deploy"]["status"] == "failed"
    assert "endpoint" not in project.nodes()
    assert not (project.state / "deploy").exists()
    before = len(project.agent_runs())
    project.script = {}
    project.apply(status=1)
    assert project.stages_run()[before:] == ["deploy"], "a server of an earlier run is only remade when a plan says so"
    project.apply("-replace", "serve", "-target", "deploy", status=0)


@pytest.mark.parametrize("stage", ["serve", "deploy"])
def test_a_stage_that_is_sent_back_to_has_the_budget_of_one_run(project: Project, stage: str) -> None:
    path = project.outside / "dead.py"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(BAD["dead library"])
    project.script = {"serve": [{"copy": str(path)}]}
    project.manifest = {"stages": f"{{{stage}: {{budget: {{attempts: 1}}}}}}"}
    done = project.apply(status=1)
    assert (project.stages_run().count("serve"), project.stages_run().count("deploy")) == (1, 1)
    assert f"the budget of {stage} has nothing left to fix it with" in done.text
    assert "ENDPOINT-TOOL-BROKEN" in done.text
