"""Servers that must not be served: each bad one is an attempt of one run, refused by name; then a good one goes live.

One project and one test for all of them, because each serving environment costs two seconds.
"""

import json
from pathlib import Path

from projects import Done, Project

GOOD = (Path(__file__).parents[1] / "agent" / "good" / "server.py").read_text()
READS = "return Temperature(celsius=round(21.5, digits))"


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
        '    return Path("/").joinpath("dev", "video9").read_bytes()\n\n\nSEEN = first()',
    ),
    "import that hangs": changed("\nmcp = FastMCP", "\nimport time\n\ntime.sleep(600)\nmcp = FastMCP"),
    "dead library": changed(READS, "import time\n\n        return Temperature(celsius=time.no_such_clock(digits))"),
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


def write(project: Project) -> None:
    """A manifest and a script in which each bad server is one attempt, and DEPLOY first says that it failed."""
    attempts = []
    for name, text in BAD.items():
        path = project.outside / f"{name}.py"
        path.write_text(text)
        attempts.append({"copy": str(path)})
    failed = [[["status"], "error"], [["error"], "no compiler here"]]
    project.script = {"serve": attempts, "deploy": [{"mutate": failed}, "good"]}
    project.manifest = {
        "budget": "{attempt_timeout: 10s}",
        "stages": f"{{serve: {{budget: {{attempts: {len(BAD)}}}}}, deploy: {{budget: {{attempts: 2}}}}}}",
    }


def test_f05_f06_f08c_servers_that_must_not_be_served_are_refused_by_name_and_a_good_one_goes_live(
    project: Project,
) -> None:
    write(project)
    first = project.apply(status=1)
    found = dict(zip(REFUSED, refusals(first, "serve"), strict=True))
    assert {name: codes for name, codes in found.items() if not codes & REFUSED[name]} == {}
    assert project.nodes()["serve"]["status"] == "accepted"

    # The dead library imports well; only a call of the tool shows it.
    said_error, dead = refusals(first, "deploy")
    assert "DEPLOY-STATUS-ERROR" in said_error
    assert "ENDPOINT-TOOL-BROKEN" in dead
    assert "no_such_clock" in first.out
    assert project.nodes()["deploy"]["status"] == "failed"
    assert "endpoint" not in project.nodes()
    assert not (project.state / "deploy").exists()

    project.script = {}
    before = len(project.agent_runs())
    done = project.apply("-replace", "serve", status=0)
    assert project.stages_run()[before:] == ["serve", "deploy"]
    assert json.loads(done.out.splitlines()[-1])["result"]["endpoint"]["tools"] == ["read_temperature"]
