"""Programs that a server starts by its own choice: one that is not here is told before the server is accepted."""

from types import SimpleNamespace
from typing import Any

import pytest

from octoform.apply.stage.acceptance import judge
from octoform.apply.stage.assignment import absent_programs, judge_server, of_stage
from octoform.contracts.rules.serve.programs import started_blindly
from octoform.endpoint.environment.system_programs import chosen_programs

_SERVER = """import shutil
import subprocess


def play():
    subprocess.run(["no-such-player", "-q"], timeout=30)


def health():
    try:
        return subprocess.run(["no-such-health"], capture_output=True, timeout=5).stdout
    except FileNotFoundError:
        raise ToolError("no-such-health is missing; Debian has it in health-tools") from None


def volume():
    if shutil.which("no-such-mixer") is None:
        raise ToolError("no-such-mixer is missing")
    return subprocess.run(["no-such-mixer"], capture_output=True, timeout=5).stdout


def kernel():
    return subprocess.run(["sh", "-c", "uname"], capture_output=True, timeout=5).stdout


def mixed():
    try:
        return subprocess.run(["no-such-mix"], capture_output=True, timeout=5).stdout
    except subprocess.TimeoutExpired:
        return b""
"""


def test_a_program_whose_absence_is_reported_is_no_finding_and_one_of_a_tool_that_acts_is() -> None:
    assert set(started_blindly(_SERVER)) == {"no-such-player", "sh", "no-such-mix"}
    assert chosen_programs(_SERVER, {"tools": []}) == {"no-such-mix": 28, "no-such-player": 6}


@pytest.mark.parametrize("said", ["Plays a tone with no-such-player.", "via `no-such-player`, from a file"])
def test_a_program_that_interface_names_costs_its_tools_later_and_is_not_refused_here(said: str) -> None:
    assert chosen_programs(_SERVER, {"tools": [{"name": "play", "description": said}]}) == {"no-such-mix": 28}


def test_the_finding_says_what_the_stage_can_do_and_a_recorded_host_has_none() -> None:
    first, second = absent_programs(_SERVER, {"tools": []}, {}, "serve/server.py")
    assert (first.code, first.span and first.span.line, second.span and second.span.line) == (
        "SERVE-PROGRAM-MISSING",
        28,
        6,
    )
    assert "raise ToolError" in (first.hint or "") and "no-such-player" in (second.source or "")
    assert absent_programs(_SERVER, {"tools": []}, {"OCTOFORM_SYSROOT": "/hosts/x"}, "serve/server.py") == []


@pytest.mark.parametrize(
    ("stage", "harness", "judged"),
    [("serve", "command", judge_server), ("serve", "builtin", judge), ("deploy", "command", judge)],
)
def test_a_server_that_an_agent_writes_is_held_to_the_programs_of_this_host(
    stage: str, harness: str, judged: object
) -> None:
    manifest: Any = SimpleNamespace(
        harness_for=lambda _: SimpleNamespace(name=harness), budget_for=lambda _: None, model_for=lambda _: None
    )
    context: Any = SimpleNamespace(manifest=manifest)
    assert of_stage(context, stage).judge is judged
