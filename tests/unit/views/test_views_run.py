"""A run as a person and as a program see it: the same events, in words and in JSON lines."""

import io
import json
import re
from datetime import UTC, datetime
from typing import TextIO

import pytest

from octoform import events
from octoform.diagnostics import error
from octoform.engine.results import EndpointSummary, Funnel, RunResult
from octoform.plan.model import Plan
from octoform.views.apply import RunHuman, RunJson
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream

REFUSED = error("IDENTIFY-INVENTED-DEVICE", "a device that PROBE never saw\x1b[31m", hint="take it out")
EVENTS = [
    events.Notice("", "cleared the lock of a dead process"),
    events.NodeStarted("identify", "create"),
    events.AttemptStarted("identify", 1, 3, "command"),
    events.AttemptProgress("identify", "reading", 1.0),
    events.AttemptProgress("identify", "", 12.0),
    events.AttemptFailed("identify", 1, (REFUSED,), 13.0),
    events.AttemptStarted("identify", 2, 3, "command"),
    events.Checking("identify", "looking again"),
    events.NodeAccepted("identify", 2, 15.0, "2 annotated", changed=True),
    events.NodeUnchanged("interface", "its inputs came out the same"),
    events.NodeFailed("serve", (REFUSED,), 2.0),
    events.NodeDestroyed("deploy"),
]
RESULT = RunResult(
    "apply",
    "bench",
    added=1,
    failed="serve",
    diagnostics=(REFUSED, REFUSED),
    funnel=Funnel(seen=9, annotated=2, unknown=1, left_out=7, tools=1),
)


def console() -> Console:
    return Console(io.StringIO(), io.StringIO(), colour=False, colour_err=False, interactive=False)


def printed(stream: TextIO) -> str:
    assert isinstance(stream, io.StringIO)
    return stream.getvalue()


def shown(result: RunResult) -> tuple[str, str]:
    screen = console()
    view = RunHuman(screen)
    with view.watching() as sink:
        for event in EVENTS:
            sink(event)
    view.ended(result)
    return printed(screen.out), printed(screen.err)


def test_every_event_is_a_line_and_nothing_foreign_reaches_the_terminal() -> None:
    out, err = shown(RESULT)
    assert "attempt 1 of 3, command" in out
    assert "still running, 12 s elapsed" in out
    assert "IDENTIFY-INVENTED-DEVICE: a device that PROBE never saw\\x1b[31m" in out
    assert "✓ identify   2 annotated  (15.0 s, 2 attempts)" in out
    assert "= interface  its inputs came out the same" in out
    assert "✗ serve" in out
    assert "cleared the lock of a dead process" in out
    assert "\x1b" not in out + err
    assert err.count("IDENTIFY-INVENTED-DEVICE") == 1
    assert "Apply stopped: serve failed." in out
    counts = {word: int(count) for word, count in re.findall(r"^  (\w+) +(\d+)   \w", out, re.MULTILINE)}
    assert counts == {"discovered": 9, "identified": 1, "unknown": 1, "skipped": 7, "tools": 1}


def test_a_good_end_names_the_endpoint_and_the_next_command() -> None:
    endpoint = EndpointSummary(
        "octoform connect bench", "local", None, ("read_clock",), "read_clock answered", "read_clock"
    )
    out, err = shown(RunResult("apply", "bench", added=6, endpoint=endpoint, commit="0123456789abcdef"))
    assert "Apply complete! Resources: 6 added, 0 changed, 0 destroyed." in out
    assert "octoform call read_clock" in out
    assert "committed   0123456789ab" in out
    assert err == ""


def test_the_stream_has_a_version_first_and_one_object_a_line() -> None:
    screen = console()
    view = RunJson(JsonStream(screen, lambda: datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)))
    view.plan(Plan("bench", "apply", ()))
    with view.watching() as sink:
        for event in EVENTS:
            sink(event)
    view.ended(RESULT)
    lines = [json.loads(line) for line in printed(screen.out).splitlines()]
    assert lines[0]["type"] == "version"
    assert {line["@timestamp"] for line in lines} == {"2026-01-02T03:04:05.000Z"}
    assert [line["type"] for line in lines].count("attempt_errored") == 1
    assert lines[-1]["type"] == "run_summary"
    assert lines[-1]["result"]["failed"] == "serve"
    assert view.approve() is False


@pytest.mark.parametrize(
    ("result", "words"),
    [
        (RunResult("apply", "bench", failed="approval"), "Apply cancelled: nothing was done."),
        (RunResult("destroy", "bench", failed="approval"), "Destroy cancelled: nothing was done."),
        (RunResult("apply", "bench", failed="commit"), "Apply done, but not committed: see the error above."),
        (RunResult("apply", "", failed="compile"), "Apply stopped: see the error above."),
        (
            RunResult("apply", "bench", failed="saved plan", refused=("identify", "interface")),
            "Apply stopped: the saved plan is no longer valid for identify and interface.",
        ),
    ],
)
def test_a_run_that_did_nothing_does_not_speak_of_what_was_accepted(result: RunResult, words: str) -> None:
    screen = console()
    RunHuman(screen).ended(result)
    assert printed(screen.out).strip() == words
