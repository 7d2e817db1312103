"""The views of attempts: each one's end, also of those that never got a record; and nothing that acts."""

import io
import json
import os
from pathlib import Path
from typing import Any

import pytest
from attempt_folders import Folders

from octoform.base import processes
from octoform.diagnostics import error, to_json, warning
from octoform.engine.inspect import attempts as engine
from octoform.harness.containment import orphans
from octoform.harness.port import (
    AgentEvent,
    Closed,
    ExitReason,
    ModelProblem,
    Output,
    ToolCalled,
    ToolReturned,
    Turn,
    Usage,
)
from octoform.state.attempts import SpecEdit
from octoform.state.store.lock import acquire
from octoform.views import attempts as views
from octoform.views.format.console import Console

REFUSED: dict[str, Any] = {
    "diagnostics": [to_json(error("PROBE-DUPLICATE-ID", "twice")), to_json(error("PROBE-NO-WORKING-SCAN", "x"))]
}
HOSTILE = "\x1b]0;owned\x07\u202eevil\r\nsecond line"


@pytest.fixture
def folders(tmp_path: Path) -> Folders:
    return Folders(tmp_path)


def states(folders: Folders) -> list[str]:
    found, problems = engine.listed(folders.project, {})
    assert problems == []
    return [item.state for item in found or []]


def detail(folders: Folders, number: int) -> engine.Detail:
    found, problems = engine.detail(folders.project, {}, number)
    assert found is not None, problems
    return found


def shown(folders: Folders, number: int | None = None, *, colour: bool = False, as_json: bool = False) -> str:
    out = io.StringIO()
    console = Console(out, out, colour, colour, False)
    if number is None:
        found, _ = engine.listed(folders.project, {})
        views.listing(console, found or [], everything=False, as_json=as_json)
    else:
        views.one(console, detail(folders, number), as_json=as_json)
    return out.getvalue()


def test_each_end_has_its_word(folders: Folders) -> None:
    folders.add("probe", 1, **REFUSED)
    folders.add("probe", 2, reason="timeout", diagnostics=[to_json(error("APPLY-TIMEOUT", "late"))])
    folders.add("probe", 3, accepted=True, diagnostics=[to_json(warning("PROBE-UNESCAPED-TEXT", "odd"))])
    folders.add("identify", 1, record=False)
    assert states(folders) == ["refused", "timeout", "accepted", "interrupted"]
    lines = shown(folders).splitlines()
    assert "refused PROBE-DUPLICATE-ID (+1)" in lines[1]
    assert "timeout" in lines[2] and "APPLY-TIMEOUT" not in lines[2]
    assert "accepted" in lines[3] and "PROBE-UNESCAPED-TEXT" not in lines[3]


def test_the_newest_runs_while_the_lock_is_held(folders: Folders) -> None:
    folders.add("probe", 1, record=False)
    folders.add("probe", 1, record=False)
    acquired = acquire(folders.layout, "apply")
    assert acquired.lock is not None
    with acquired.lock:
        assert states(folders) == ["interrupted", "running"]
    assert states(folders) == ["interrupted", "interrupted"]


def test_an_agent_whose_supervisor_lives_runs(folders: Folders) -> None:
    folder = folders.add("probe", 1, record=False)
    me = orphans.look(os.getpid())
    assert me is not None
    orphans.write(folder, orphans.Record(processes.new(), me.pid, me.start))
    assert states(folders) == ["running"]
    orphans.write(folder, orphans.Record(processes.new(), me.pid, me.start, ended=True))
    assert states(folders) == ["interrupted"]
    orphans.write(folder, orphans.Record(processes.new(), me.pid, me.start + 1))
    assert states(folders) == ["interrupted"]


def test_a_record_that_denies_its_folder_is_not_believed(folders: Folders) -> None:
    folders.add("probe", 1, accepted=True, number=7)
    assert states(folders) == ["interrupted"]


def test_only_a_stage(folders: Folders) -> None:
    folders.add("probe", 1, accepted=True)
    folders.add("identify", 1, accepted=True)
    found, _ = engine.listed(folders.project, {}, "identify")
    assert [item.stage for item in found or []] == ["identify"]


def test_the_latest_twenty_and_how_many_more(folders: Folders) -> None:
    for _ in range(23):
        folders.add("probe", 1, accepted=True)
    text = shown(folders)
    assert "3 older; -all shows them" in text
    assert len(text.splitlines()) == 22
    document = json.loads(shown(folders, as_json=True))
    assert (document["format"], document["older"], document["attempts"][-1]["number"]) == (1, 3, 23)


def test_none_yet_says_what_to_do(folders: Folders) -> None:
    assert "octoform apply" in shown(folders)
    assert engine.detail(folders.project, {}, 1)[1][0].code == "ATTEMPT-UNKNOWN"


def test_an_unknown_number_names_those_there_are(folders: Folders) -> None:
    folders.add("probe", 1)
    found, problems = engine.detail(folders.project, {}, 9)
    assert found is None
    assert "1 to 1" in str(problems[0].hint)


def test_everything_about_one(folders: Folders) -> None:
    folder = folders.add(
        "probe",
        1,
        model="openai/x",
        program="pi 1.2",
        turns=3,
        usage={
            "input_tokens": 1200,
            "cached_tokens": 200,
            "output_tokens": 30,
            "cost_usd": 0.5,
            "cost_source": "litellm",
        },
        files=["output.json", "notes.txt"],
        exit_status=0,
        detail="a word",
        events=[
            ToolCalled("bash", "ls /sys"),
            ToolReturned(True),
            ModelProblem(ExitReason.RATE_LIMIT, "429 slow down"),
            Closed(False, "gave up"),
        ],
        **REFUSED,
    )
    text = shown(folders, 1)
    for part in (
        "refused PROBE-DUPLICATE-ID (+1)",
        "pi, openai/x (pi 1.2)",
        "finished after 1.5 s, exit status 0, 3 turns",
        "1.2k in, 30 out, $0.50, priced by litellm, 200 of them cached",
        f"{folder / 'prompt.md'}, 11 bytes",
        "agent.log",
        "1 tool call, 1 failed",
        "0.0s  bash  ls /sys",
        "rate_limit  429 slow down",
        "closed  gave up",
        "notes.txt",
        "error[PROBE-DUPLICATE-ID]: twice",
    ):
        assert part in text, part
    document = json.loads(shown(folders, 1, as_json=True))
    assert document["tool_calls"] == [{"at": 0.0, "tool": "bash", "text": "ls /sys"}]
    assert [item["reason"] for item in document["troubles"]] == ["rate_limit", None]
    assert document["usage"]["cost_source"] == "litellm"
    assert document["state"] == "refused"


def test_of_many_calls_some_are_shown(folders: Folders) -> None:
    folders.add("probe", 1, events=[ToolCalled("bash", str(number)) for number in range(250)])
    text = shown(folders, 1)
    assert "250 tool calls" in text
    assert "and 50 more, in the transcript" in text
    assert len(json.loads(shown(folders, 1, as_json=True))["tool_calls"]) == 200


def test_an_attempt_without_a_record_can_be_shown(folders: Folders) -> None:
    folders.add("probe", 1, record=False, events=[ToolCalled("bash", "ls")])
    assert "interrupted" in shown(folders, 1)
    assert json.loads(shown(folders, 1, as_json=True))["state"] == "interrupted"


def test_an_attempt_without_a_record_tells_what_it_has_used_so_far(folders: Folders) -> None:
    replies: list[AgentEvent] = [
        Turn(Usage(1000, 400, 50)),
        ToolCalled("bash", "ls"),
        Turn(Usage(500, None, 7)),
        Output("x"),
    ]
    folder = folders.add("identify", 2, record=False, events=replies)
    task = {"format": 1, "stage": "identify", "role": "escalate", "harness": "pi", "model": "openai/x"}
    (folder / "task.json").write_text(json.dumps(task))
    line = shown(folders).splitlines()[1]
    for part in ("identify (escalate)", "pi, openai/x", "interrupted", "3.0s", "  2  ", "1.5k/57"):
        assert part in line, part
    text = shown(folders, 1)
    assert "interrupted after 3.0 s, 2 turns" in text
    assert "1.5k in, 57 out, cost unknown, 400 of them cached" in text
    acquired = acquire(folders.layout, "apply")
    assert acquired.lock is not None
    with acquired.lock:
        assert "running for" in shown(folders, 1)
    assert detail(folders, 1).attempt.record is None


@pytest.mark.parametrize(
    "task", [b"", b"[]", b"{", b'{"harness": 1, "model": [], "role": {}}', json.dumps({"model": "\ud800"}).encode()]
)
def test_a_task_that_an_agent_has_spoilt_tells_nothing(folders: Folders, task: bytes) -> None:
    folder = folders.add("probe", 1, record=False)
    (folder / "task.json").write_bytes(task)
    assert states(folders) == ["interrupted"]
    assert "interrupted" in shown(folders, 1)
    assert json.loads(shown(folders, 1, as_json=True))["harness"] == ""


EDITED: dict[str, Any] = {"spec_edit": SpecEdit(digest="sha256:x", permitted=True, added=1, removed=0)}


def test_an_edit_is_shown_against_what_the_attempt_was_given(folders: Folders) -> None:
    folders.add("probe", 1, spec="# one\n", **REFUSED)
    folders.add("probe", 2, spec="# one\ntwo\n", **EDITED, **REFUSED)
    folders.add("probe", 3, spec="# one\ntwo\nthree\n", **EDITED, accepted=True)
    found = detail(folders, 3).spec
    assert found is not None and found.certain
    assert [line for line in found.lines if line.startswith("+") and not line.startswith("+++")] == ["+three"]
    first = detail(folders, 2).spec
    assert first is not None and "+two" in first.lines
    assert "1 line added, 0 removed" in shown(folders, 2)


def test_an_edit_that_was_not_asked_for_is_said_and_does_not_count_for_the_next(folders: Folders) -> None:
    unasked: dict[str, Any] = {"spec_edit": SpecEdit(digest="sha256:x", permitted=False, added=1, removed=0)}
    folders.add("probe", 1, spec="# one\n", **REFUSED)
    folders.add("probe", 2, spec="# one\nmine\n", **unasked, **REFUSED)
    folders.add("probe", 3, spec="# one\nthree\n", **EDITED, **REFUSED)
    assert "not asked to" in shown(folders, 2)
    found = detail(folders, 3).spec
    assert found is not None and found.certain
    assert "+three" in found.lines and "-mine" not in found.lines


def test_an_edit_of_another_run_is_not_the_text_that_was_given(folders: Folders) -> None:
    folders.add("probe", 1, spec="# another run\n")
    folders.add("probe", 1, spec="# mine\n", spec_edit=SpecEdit(digest="x", permitted=False, added=1, removed=0))
    found = detail(folders, 2).spec
    assert found is not None
    assert not found.certain, "the project's own spec is no longer what this attempt was given"
    assert "the spec of today" in shown(folders, 2)


def test_nothing_foreign_acts_on_the_terminal(folders: Folders) -> None:
    folders.add(
        "probe",
        1,
        harness=HOSTILE,
        model=HOSTILE,
        program=HOSTILE,
        detail=HOSTILE,
        files=[HOSTILE],
        reason=HOSTILE,
        started_at=HOSTILE,
        spec=f"{HOSTILE}\n",
        usage={"input_tokens": 1, "cost_usd": 1.0, "cost_source": HOSTILE},
        diagnostics=[to_json(error(HOSTILE, HOSTILE, path=HOSTILE, detail=HOSTILE, hint=HOSTILE))],
        events=[
            Output(HOSTILE),
            ToolCalled(HOSTILE, HOSTILE),
            ModelProblem(ExitReason.AUTH, HOSTILE),
            Closed(False, HOSTILE),
        ],
        **EDITED,
    )
    for text in (shown(folders), shown(folders, 1)):
        assert not set(text) & set("\x1b\x07\u202e\r")
        assert "\\x1b" in text
    coloured = shown(folders, 1, colour=True) + shown(folders, colour=True)
    assert "\x1b]" not in coloured and "\u202e" not in coloured


def test_a_manifest_that_cannot_be_read_is_told(tmp_path: Path) -> None:
    found, problems = engine.listed(tmp_path, {})
    assert found is None
    assert problems[0].code == "MANIFEST-NOT-FOUND"
