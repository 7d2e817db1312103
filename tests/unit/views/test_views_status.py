"""Status as a person and as a program read it, whatever the process reports of itself."""

import io
import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import pytest

from octoform.base.health_status import Status as Verdict
from octoform.daemon.health import Health, Part
from octoform.daemon.status import Survey
from octoform.daemon.store.instance_lock import Record
from octoform.endpoint.process.record import Running
from octoform.engine.project_status import Process, Status
from octoform.state.store.lock import myself
from octoform.views.daemon import status as status_view
from octoform.views.format.console import Console

RUNNING = Running(
    41, 7, ("python", "serve.py"), "aa", "2026-01-01T00:00:00+00:00", "internet", "http://10.0.0.2:7777/mcp"
)
TOLD: dict[str, Any] = {
    "pid": 41,
    "clients": 1,
    "tunnel": {"state": "running", "url": "https://x.example", "since": "2026-01-01T00:00:09Z", "reason": None},
    "gate": {
        "mode": "shadow",
        "running": 1,
        "stuck": [{"tool": "move_rail", "caller": "local", "buses": ["usb-1"], "seconds": 12.5}],
        "approvals": 2,
        "audit": "No space left on device",
    },
    "later": {"nobody": "knows"},
}


def shown(
    found: Status, watched: Record | None = None, *, verdict: Verdict = Verdict.HEALTHY, as_json: bool = False
) -> tuple[int, str]:
    out = io.StringIO()
    console = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    parts = () if verdict is Verdict.HEALTHY else (Part("endpoint", verdict, "its process does not run"),)
    surveyed = Survey(Health("bench", "", 0.0, verdict, parts), watched, watched is None, 0.0)
    return status_view.status(console, found, surveyed, as_json=as_json), out.getvalue()


def status(told: Mapping[str, Any] | None = None, **more: Any) -> Status:
    process = Process(RUNNING, TOLD if told is None else told, None, 3)
    return Status("bench", True, tools=("a", "b"), process=process, **more)


def test_a_recorded_host_is_called_one() -> None:
    found = shown(status(recorded="/hosts/x"), verdict=Verdict.UNKNOWN)[1].splitlines()[1]
    assert found == "  The host is the recorded or simulated one in /hosts/x (OCTOFORM_SYSROOT), not this machine."
    assert json.loads(shown(status(recorded="/hosts/x"), as_json=True)[1])["recorded"] is True


def test_a_healthy_host_tells_what_runs() -> None:
    code, text = shown(status())
    assert code == 0
    assert text.splitlines() == [
        "host bench: in sync, healthy",
        "  the endpoint answers with 2 tools",
        "  process 41 since 2026-01-01T00:00:00+00:00, scope internet, 1 local client",
        "  at http://10.0.0.2:7777/mcp, open to 3 tokens",
        "  tunnel: https://x.example since 2026-01-01T00:00:09Z",
        "  the policy only watches (mode shadow): nothing is refused",
        "  stuck: move_rail for 12.5 s, which keeps usb-1 (octoform restart ends it)",
        "  2 calls waiting for an approval",
        "  the audit log cannot be written: No space left on device",
        "  no one watches it: octoform watch keeps it alive",
    ]


def test_who_watches_is_told() -> None:
    daemon = Record(replace(myself(), pid=77), "2026-01-01T00:01:00Z", 9.0, "1")
    _, text = shown(status(), daemon)
    assert text.endswith(
        "a daemon watches it: process 77 since 2026-01-01T00:01:00Z; octoform health shows its findings\n"
    )
    assert json.loads(shown(status(), daemon, as_json=True)[1])["watched"] == 77
    assert json.loads(shown(status(), as_json=True)[1])["watched"] is None


def test_a_tunnel_that_is_not_there_says_why() -> None:
    for state, reason in (
        ("revoked", "revoked; octoform start opens a new one"),
        ("not running", "there is no program"),
    ):
        _, text = shown(status({"tunnel": {"state": state, "url": None, "reason": reason}}))
        assert f"  tunnel: {state} ({reason})" in text.splitlines()


def test_a_dry_run_of_everything_says_that_readings_are_done() -> None:
    _, text = shown(status({"gate": {"mode": "dry_run"}}))
    assert "  what would move is a dry run (mode dry_run): only readings are done" in text.splitlines()


def test_what_a_process_of_another_version_does_not_tell_is_left_out() -> None:
    _, text = shown(status({}))
    assert text.splitlines()[2:-1] == [
        "  process 41 since 2026-01-01T00:00:00+00:00, scope internet",
        "  at http://10.0.0.2:7777/mcp, open to 3 tokens",
    ]


def test_nothing_that_is_told_acts_on_the_terminal() -> None:
    estop = {"by": "\x1b[1manna", "reason": "smoke\nhost bench: in sync", "since": ""}
    process = Process(RUNNING, {"tunnel": {"state": "x", "reason": "\x1b]0;title\x07"}}, estop)
    code, text = shown(Status("bench", True, ("why \x1b[2J",), process=process), verdict=Verdict.DOWN)
    assert code == 5
    assert "\x1b" not in text and "\x07" not in text
    assert "  emergency stop engaged by \\x1b[1manna: smoke host bench: in sync" in text


def test_a_program_reads_everything_that_the_process_told() -> None:
    code, text = shown(status(), as_json=True)
    found = json.loads(text)
    assert code == 0
    assert (found["in_sync"], found["health"], found["running"], found["tokens"]) == (True, "healthy", True, 3)
    assert found["process"]["url"] == RUNNING.url
    assert found["process"]["later"] == {"nobody": "knows"}
    code, text = shown(Status("bench", True), verdict=Verdict.DOWN, as_json=True)
    found = json.loads(text)
    assert (code, found["health"], found["process"], found["running"]) == (5, "down", None, False)
    assert found["reasons"] == ["endpoint: its process does not run"]


@pytest.mark.parametrize(
    ("sync", "verdict", "code"),
    [
        (True, Verdict.HEALTHY, 0),
        (False, Verdict.HEALTHY, 1),
        (True, Verdict.DEGRADED, 3),
        (False, Verdict.ERROR, 4),
        (True, Verdict.DOWN, 5),
        (True, Verdict.UNKNOWN, 6),
    ],
)
def test_the_exit_code_is_that_of_health_and_drift_is_one(sync: bool, verdict: Verdict, code: int) -> None:
    left, text = shown(Status("bench", sync), verdict=verdict)
    assert left == code
    assert text.splitlines()[0].endswith(f", {verdict}")
