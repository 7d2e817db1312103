"""Programs that a server starts by its own choice: one that is not here is reported before the server is accepted."""

import sqlite3
from contextlib import closing
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from octoform.apply.stage.acceptance import judge
from octoform.apply.stage.assignment import (
    absent_programs,
    judge_interface,
    judge_server,
    lacking_programs,
    of_stage,
)
from octoform.contracts.rules.serve.code_rules import started_blindly
from octoform.endpoint.environment.system_programs import COMMANDS, chosen_programs, lacks

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
    assert chosen_programs(_SERVER, {"tools": []}, {}) == {"no-such-mix": 28, "no-such-player": 6}


@pytest.mark.parametrize("said", ["Plays a tone with no-such-player.", "via `no-such-player`, from a file"])
def test_a_program_that_interface_names_costs_its_tools_later_and_is_not_refused_here(said: str) -> None:
    assert chosen_programs(_SERVER, {"tools": [{"name": "play", "description": said}]}, {}) == {"no-such-mix": 28}


def test_the_finding_says_what_the_stage_can_do_and_a_recorded_host_has_none() -> None:
    first, second = absent_programs(_SERVER, {"tools": []}, {}, "serve/server.py")
    assert (first.code, first.span and first.span.line, second.span and second.span.line) == (
        "SERVE-PROGRAM-MISSING",
        28,
        6,
    )
    assert "raise ToolError" in (first.hint or "") and "no-such-player" in (second.source or "")
    assert absent_programs(_SERVER, {"tools": []}, {"OCTOFORM_SYSROOT": "/hosts/x"}, "serve/server.py") == []


def test_a_recorded_host_has_the_programs_that_were_recorded(tmp_path: Path) -> None:
    environ = {"OCTOFORM_SYSROOT": str(tmp_path)}
    assert not lacks("no-such-player", environ) and not lacks("sh", environ), "nothing is known"
    (tmp_path / "usr/bin").mkdir(parents=True)
    (tmp_path / "usr/bin/no-such-player").touch()
    assert not lacks("no-such-player", environ) and lacks("sh", environ)


SAID = "Read how the disk is.\n\nThrough: {}"


@pytest.mark.parametrize(
    ("through", "programs"),
    [
        ("`no-such-health -j`, class block.", ["no-such-health"]),
        ("no-such-health --json of the disk; `temp1_input` beside it.", ["no-such-health"]),
        ("the program no-such-health, then the utility `no-such-disk`.", ["no-such-disk", "no-such-health"]),
        ("the class block; lines of `mean` and `variance`, a program that is here: sh -c.", []),
        ("serial, 9600 baud - 8N1; the command lines of the profile.", []),
    ],
)
def test_a_program_that_interface_names_is_told_there_with_its_package(
    tmp_path: Path, through: str, programs: list[str]
) -> None:
    (tmp_path / "usr/bin").mkdir(parents=True)
    (tmp_path / "usr/bin/sh").touch()
    path = tmp_path / COMMANDS
    path.parent.mkdir(parents=True)
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE packages (pkgID INTEGER PRIMARY KEY, name TEXT, priority INTEGER)")
        database.execute("CREATE TABLE commands (cmdID INTEGER PRIMARY KEY, pkgID INTEGER, command TEXT)")
        database.execute("INSERT INTO packages VALUES (7, 'health-tools', 0)")
        database.execute("INSERT INTO commands VALUES (1, 7, 'no-such-health')")
        database.commit()
    interface = {"tools": [{"name": "read_disk_health", "description": SAID.format(through)}]}
    found = lacking_programs(interface, {"OCTOFORM_SYSROOT": str(tmp_path)}, "interface/output.json")
    assert [item.summary.split("'")[1] for item in found] == programs
    assert all(item.code == "INTERFACE-PROGRAM-MISSING" and "read_disk_health" in item.summary for item in found)
    assert all(("'health-tools'" in (item.hint or "")) == ("no-such-health" in item.summary) for item in found)
    assert lacking_programs(interface, {"OCTOFORM_SYSROOT": "/hosts/x"}, "interface/output.json") == []


@pytest.mark.parametrize(
    ("stage", "harness", "judged"),
    [
        ("serve", "command", judge_server),
        ("serve", "builtin", judge),
        ("deploy", "command", judge),
        ("interface", "builtin", judge_interface),
    ],
)
def test_a_server_that_an_agent_writes_is_held_to_the_programs_of_this_host(
    stage: str, harness: str, judged: object
) -> None:
    manifest: Any = SimpleNamespace(
        harness_for=lambda _: SimpleNamespace(name=harness), budget_for=lambda _: None, model_for=lambda _: None
    )
    context: Any = SimpleNamespace(manifest=manifest)
    assert of_stage(context, stage).judge is judged
