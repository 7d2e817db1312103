"""Hostile strings in what an agent prints and what a contract quotes: prompts, terminals, streams, records, graphs."""

import io
import json
import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pyte
import pytest
from cases import for_each
from hostile_strings import STRINGS, Hostile

from octoform import events
from octoform.base.escaping import is_hidden
from octoform.diagnostics import Diagnostic, Span, error, to_json
from octoform.engine.results import RunResult
from octoform.graph.model import Graph, Node, NodeKind, to_dot, to_mermaid
from octoform.harness.port import TaskLimits
from octoform.harness.watcher import Watcher
from octoform.protocol import MAX_PROMPT_BYTES, STAGES, Prompt, render_prompt
from octoform.protocol.spec_loader import load
from octoform.runtime import calllog
from octoform.state import attempts
from octoform.state.attempts import AttemptRecord
from octoform.views.apply import RunHuman, RunJson
from octoform.views.format.console import Console
from octoform.views.format.output import JsonStream

EACH = for_each("hostile", STRINGS)
SPECS = load(None)[0]
BENIGN = "nothing to see"
FENCED = re.compile(r"^(`{3,})text data=(\w+)\n(.*?)^\1$", re.MULTILINE | re.DOTALL)


def hidden(text: str) -> set[str]:
    return {sign for sign in {*text} - {*"\n\t"} if is_hidden(sign)}


def quoting(text: str) -> tuple[Diagnostic, ...]:
    """Diagnostics that quote a text wherever one can be quoted."""
    return (
        error("IDENTIFY-SCHEMA", f"it says {text}", path=text, pointer=f"/devices/{text}", detail=text, hint=text),
        error("SERVE-SYNTAX", text, span=Span(1, 1), source=text),
    )


def prompt(stage: str, **more: Any) -> str:
    given: dict[str, Any] = {
        "spec": SPECS[stage],
        "output": Path("/work/attempt/output.json"),
        "input": None if stage == "probe" else Path("/state/before/output.json"),
        "workdir": Path("/work/attempt"),
        "own_spec": Path("/work/attempt/spec.md"),
        "tools": 30,
        "wall_seconds": 200.0,
    }
    return render_prompt(Prompt(**{**given, **more}))


@EACH
def test_a_first_prompt_holds_nothing_of_a_device(hostile: Hostile, tmp_path: Path) -> None:
    artifact = tmp_path / "output.json"
    for stage in STAGES[1:]:
        artifact.write_bytes(b"{}")
        before = prompt(stage, input=artifact)
        artifact.write_bytes(hostile.data)
        assert prompt(stage, input=artifact) == before


@EACH
@for_each("stage", ["identify", "serve"])
def test_in_a_retry_it_stays_inside_its_fence(hostile: Hostile, stage: str, tmp_path: Path) -> None:
    log = tmp_path / "agent.log"

    def retry(text: str, data: bytes) -> str:
        log.write_bytes(data)
        return prompt(stage, failed_log=log, diagnostics=quoting(text))

    expected = retry(BENIGN, BENIGN.encode())
    found = retry(hostile.text.encode("utf-8", "replace").decode(), b"the agent said\n" + hostile.data + b"\n")
    assert len(found.encode()) <= MAX_PROMPT_BYTES
    assert not hidden(found)
    assert [match[2] for match in FENCED.finditer(found)] == [match[2] for match in FENCED.finditer(expected)]
    assert FENCED.sub("", found) == FENCED.sub("", expected)


EVENTS: list[Callable[[str], events.Event]] = [
    lambda text: events.Notice("probe", text),
    lambda text: events.AttemptStarted("probe", 1, 3, text),
    lambda text: events.AttemptProgress("probe", text, 1.0),
    lambda text: events.AgentActed("probe", text, text, 1.0),
    lambda text: events.SpecEdited("probe", 1, False, (f"+{text}",)),
    lambda text: events.AttemptFailed("probe", 1, quoting(text), 1.0),
    lambda text: events.Checking("probe", text),
    lambda text: events.NodeAccepted("probe", 1, 1.0, text, changed=True),
    lambda text: events.NodeUnchanged("probe", text),
    lambda text: events.NodeFailed("probe", quoting(text), 1.0),
]


def console(out: io.StringIO, colour: bool = False) -> Console:
    return Console(out, out, colour=colour, colour_err=colour, interactive=False)


@EACH
def test_nothing_of_it_acts_on_a_terminal(hostile: Hostile) -> None:
    out = io.StringIO()
    view = RunHuman(console(out))
    with view.watching() as sink:
        for make in EVENTS:
            sink(make(hostile.text))
    view.ended(RunResult("apply", "bench", failed="probe", diagnostics=quoting(hostile.text)))
    assert not hidden(out.getvalue())


class Titles(pyte.Screen):
    """A terminal that draws no letters, which takes most of the time: what acts on it does so without them."""

    def draw(self, data: str) -> None:
        pass


@EACH
def test_a_coloured_screen_shows_no_other_title_or_colour(hostile: Hostile) -> None:
    out = io.StringIO()
    view = RunHuman(console(out, colour=True))
    with view.watching() as sink:
        for make in EVENTS:
            sink(make(hostile.text))
    raw = out.getvalue()
    assert not hidden(re.sub(r"\x1b\[[0-9;]*m", "", raw))
    screen = Titles(150, 60)
    pyte.ByteStream(screen).feed(raw.replace("\n", "\r\n").encode("utf-8", "replace"))
    assert screen.title == "" and screen.icon_name == ""


@EACH
def test_a_line_of_the_json_stream_is_json_without_hidden_characters(hostile: Hostile) -> None:
    out = io.StringIO()
    view = RunJson(JsonStream(console(out), lambda: datetime(2026, 1, 1, tzinfo=UTC)))
    with view.watching() as sink:
        for make in EVENTS:
            sink(make(hostile.text))
    view.ended(RunResult("apply", "bench", failed="probe", diagnostics=quoting(hostile.text)))
    lines = out.getvalue().split("\n")[:-1]
    assert len(lines) >= len(EVENTS) + 2
    values = [json.loads(line) for line in lines]
    notice = next(value for value in values if value["type"] == "log")
    assert notice["text"] == hostile.text
    assert not hidden(out.getvalue())


@EACH
def test_the_watcher_tells_printable_lines_and_the_transcript_is_json(hostile: Hostile, tmp_path: Path) -> None:
    lines: list[str] = []
    watcher = Watcher(None, TaskLimits(9.0), lambda event, *_: lines.append(getattr(event, "text", "")))
    watcher.recording(tmp_path / "transcript.jsonl")
    for piece in (hostile.data[:7], hostile.data[7:], b"\nlast line"):
        watcher.feed("stdout", piece)
    watcher.finish()
    assert lines[-1] == "last line"
    assert all(text.isprintable() and len(text) <= 200 for text in lines)
    for line in (tmp_path / "transcript.jsonl").read_text("utf-8").splitlines():
        assert json.loads(line)["event"] == "said"


@EACH
def test_the_record_of_an_attempt_is_read_back(hostile: Hostile, tmp_path: Path) -> None:
    text = hostile.text.encode("utf-8", "replace").decode()
    record = AttemptRecord(
        number=1,
        stage="probe",
        attempt=1,
        harness="command",
        started_at="2026-01-01T00:00:00Z",
        seconds=1.0,
        reason="finished",
        detail=text,
        diagnostics=[to_json(item) for item in quoting(text)],
    )
    assert attempts.write(tmp_path, record) is None
    assert attempts.read(tmp_path) == record


@EACH
def test_the_call_log_stays_ascii_json_of_bounded_lines(
    hostile: Hostile, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "calls.jsonl"
    monkeypatch.setenv("OCTOFORM_CALL_LOG", str(path))

    @calllog.logged
    def read(device: str) -> str:
        raise ValueError(device)

    with pytest.raises(ValueError):
        read(hostile.text)
    lines = path.read_bytes().splitlines()
    assert len(lines) == 2
    assert all(line.isascii() and len(line) <= calllog.LINE_CHARS for line in lines)
    assert all(isinstance(json.loads(line), dict) for line in lines)


@EACH
def test_a_drawing_of_the_graph_keeps_its_form(hostile: Hostile) -> None:
    def graph(model: str) -> Graph:
        return Graph((Node("probe", NodeKind.STAGE, (), harness="command", model=model),))

    dot, mermaid = to_dot(graph(hostile.text)), to_mermaid(graph(hostile.text))
    assert not hidden(dot + mermaid)
    assert dot.count("\n") == to_dot(graph(BENIGN)).count("\n")
    assert mermaid.count("\n") == to_mermaid(graph(BENIGN)).count("\n")
    assert re.search(r'label = "(?:[^"\\]|\\.)*"\];$', dot, re.MULTILINE)
    assert re.search(r'^ +probe\["[^"]*"\]$', mermaid, re.MULTILINE)
