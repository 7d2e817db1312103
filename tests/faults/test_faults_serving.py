"""Servers that must not be served: each bad one is an attempt of one run, refused by name; then a good one goes live.

One project for all of them, because each serving environment costs two seconds.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest
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


@dataclass(frozen=True)
class Story:
    """The project, its run with the bad servers, and what stood there after it."""

    project: Project
    first: Done
    files: tuple[str, ...]
    statuses: dict[str, str]


@pytest.fixture(scope="module")
def story(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Story]:
    folder = tmp_path_factory.mktemp("serving")
    project = Project(folder / "project", folder / "outside")
    project.outside.mkdir()
    attempts = []
    for name, text in BAD.items():
        path = project.outside / f"{name}.py"
        path.write_text(text)
        attempts.append({"copy": str(path)})
    status = [["status"], "error"], [["error"], "no compiler here"]
    project.script = {"serve": attempts, "deploy": [{"mutate": list(status)}, "good"]}
    project.manifest = {
        "budget": "{attempt_timeout: 10s}",
        "stages": "{serve: {budget: {attempts: 6}}, deploy: {budget: {attempts: 2}}}",
    }
    first = project.apply(status=1)
    files = tuple(str(path.relative_to(project.state)) for path in project.state.rglob("*") if path.is_file())
    yield Story(project, first, files, {name: node["status"] for name, node in project.nodes().items()})


def refusals(done: Done, stage: str) -> list[set[str]]:
    """The codes of each refused attempt of a stage, in order."""
    events = [event for event in done.events() if event["type"] == "attempt_errored" and event["node"] == stage]
    return [{item["code"] for item in event["diagnostics"]} for event in events]


@pytest.mark.parametrize(("number", "name"), list(enumerate(REFUSED)))
def test_f05_f06_a_server_that_must_not_be_served_is_refused_by_name(story: Story, number: int, name: str) -> None:
    assert refusals(story.first, "serve")[number] & REFUSED[name]


def test_the_sixth_attempt_looks_good_and_is_accepted_by_serve(story: Story) -> None:
    assert len(refusals(story.first, "serve")) == 5
    assert story.statuses["serve"] == "accepted"
    assert "serve/server.py" in story.files


def test_f08c_a_deploy_that_says_error_is_refused(story: Story) -> None:
    assert "DEPLOY-STATUS-ERROR" in refusals(story.first, "deploy")[0]


def test_a_dead_library_is_found_by_calling_the_tool(story: Story) -> None:
    assert "ENDPOINT-TOOL-BROKEN" in refusals(story.first, "deploy")[1]
    assert "no_such_clock" in story.first.out
    assert story.statuses["deploy"] == "failed"
    assert "endpoint" not in story.statuses
    assert not [name for name in story.files if name.startswith("deploy/")]


def test_the_next_apply_replaces_the_server_and_goes_live(story: Story) -> None:
    project = story.project
    project.script = {}
    before = len(project.agent_runs())
    done = project.apply("-replace", "serve", status=0)
    assert project.stages_run()[before:] == ["serve", "deploy"]
    assert json.loads(done.out.splitlines()[-1])["result"]["endpoint"]["tools"] == ["read_temperature"]
