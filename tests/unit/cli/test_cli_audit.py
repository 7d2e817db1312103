"""The audit log for a person: a sentence for each record, of real calls and of every kind of record there is."""

import io
import json
import os
import re
from pathlib import Path
from typing import Any

import pytest
from launched import launched, tool

import octoform
from octoform.cli.main import main
from octoform.server.audit.audit_log import Audit
from octoform.views.endpoint import logs
from octoform.views.format.console import Console

SOURCE = '''
from fastmcp import FastMCP
from fastmcp.exceptions import ToolError
mcp = FastMCP("bench")

@mcp.tool
def move_rail(steps: int) -> int:
    """Moves the rail."""
    if steps > 1000:
        raise ToolError("the rail ends at 1000")
    if steps < 0:
        raise RuntimeError("private words")
    return steps

@mcp.tool
def read_gpio() -> str:
    """Reads lines."""
    return "0"
'''
TOOLS = [tool("move_rail", "actuate"), tool("read_gpio")]
ME = rf'\("octoform {re.escape(octoform.__version__)}", pid \d+ of uid {os.getuid()}\)'
SERVER = Path(__file__).parents[3] / "octoform" / "server"


def lines(*records: dict[str, Any]) -> list[str]:
    out = io.StringIO()
    console = Console(out, io.StringIO(), colour=False, colour_err=False, interactive=False)
    stamped = [{"seq": 7, "time": "2026-05-04T12:00:00.123Z", "prev": "0", "hash": "1", **item} for item in records]
    assert logs.records(console, stamped, 50, as_json=False) == 0
    return out.getvalue().splitlines()


def test_calls_are_told_in_sentences_with_what_came_of_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    words = [f"-chdir={tmp_path}"]
    with launched(tmp_path, SOURCE, TOOLS):
        for steps in (3, 2000, -1):
            main([*words, "call", "move_rail", "-arg", f"steps={steps}"])
        main([*words, "estop", "-reason", "smoke"])
        main([*words, "call", "move_rail", "-arg", "steps=4"])
        capsys.readouterr()
        assert main([*words, "audit"]) == 0
        found = capsys.readouterr().out
        assert main([*words, "audit", "-n", "0"]) == 0
        assert capsys.readouterr().out == ""
    for pattern in (
        r"^ +1  \d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ  started     the endpoint started, scope local$",
        rf"  allowed     move_rail\(steps=3\) for local {ME}$",
        r"  done        move_rail answered in \d+ ms$",
        r"  failed      move_rail answered with an error after \d+ ms: the rail ends at 1000$",
        r"  failed      move_rail answered with an error after \d+ ms: octoform logs has the exception under \w{8}$",
        r"  estop       emergency stop by .+ at the terminal: smoke$",
        r"  estop       no profile names a stop action: nothing was sent to any device$",
        r"  refused     move_rail\(steps=4\) for local \(.+\): emergency stop: engaged by ",
    ):
        assert re.search(pattern, found, re.MULTILINE), (pattern, found)
    assert "private words" not in found and "{" not in found


def test_an_approval_is_told_with_who_was_asked(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    monkeypatch.setattr("sys.stdin", io.StringIO())
    words = [f"-chdir={tmp_path}"]
    with launched(tmp_path, SOURCE, TOOLS, policy={"tools": {"move_rail": {"decision": "confirm"}}}):
        move = [*words, "call", "move_rail", "-arg", "steps=3"]
        assert main([*move, "-auto-approve"]) == 0
        assert main(move) == 1
        assert "no one could be asked: there is no terminal; -auto-approve approves" in capsys.readouterr().err
        assert main([*words, "audit"]) == 0
        items = [line[30:] for line in capsys.readouterr().out.splitlines()[1:]]
    client = rf'local \("octoform -auto-approve {re.escape(octoform.__version__)}", pid \d+ of uid \d+\)'
    asked = re.fullmatch(
        rf"asked       move_rail\(steps=3\) for {client}: a person has to approve it \(approval (\w{{8}})\)", items[0]
    )
    assert asked, items
    marks = rf"\(approval {asked[1]}\)"
    assert re.fullmatch(rf"allowed     move_rail\(steps=3\) for {client}: approved by -auto-approve {marks}", items[1])
    assert re.match(
        rf"asked       move_rail\(steps=3\) for local {ME}: a person has to approve it \(approval", items[3]
    )
    assert len(items) == 4, "no one was asked, so no one's word is told"


def test_every_answer_of_a_person_has_its_words() -> None:
    base = {"event": "decision", "tool": "fire", "caller": "anna", "arguments": {}, "client": "x 1", "approval": "ab"}
    refused = {**base, "decision": "refuse", "code": "range", "text": "too much"}
    items = [
        line[30:]
        for line in lines(
            {**base, "decision": "ask"},
            {**base, "decision": "allow", "answer": "approved"},
            {**refused, "answer": "approved"},
            {**refused, "code": "declined", "text": "the person declined", "answer": "declined"},
            {**refused, "code": "unable", "text": "cannot ask", "answer": "unable", "approval": ""},
            {**refused, "client": "x 1"},
        )
    ]
    assert items == [
        'asked       fire() for anna ("x 1"): a person has to approve it (approval ab)',
        'allowed     fire() for anna ("x 1"): approved by the client\'s person (approval ab)',
        'refused     fire() for anna ("x 1"): too much; it was approved by the client\'s person (approval ab)',
        'refused     fire() for anna ("x 1"): the person declined (approval ab)',
        'refused     fire() for anna ("x 1"): cannot ask',
        'refused     fire() for anna ("x 1"): too much',
    ]


def test_the_log_is_searched_by_tool_client_time_and_refusal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\nharness: builtin\n")
    folder = tmp_path / ".octoform" / "bench" / "log"
    log = Audit.open(folder)
    for number in range(400):
        mine = number % 100 == 7
        who = {"client": "planner 2" if mine else "other 1", "uid": 1000, "pid": 4000 + number, "caller": "local"}
        decision = "refuse" if number % 50 == 7 else "allow"
        tool = "aim" if number % 2 else "fire"
        log.write("decision", call=f"c-{number}", tool=tool, decision=decision, arguments={}, **who)
        log.write("outcome", call=f"c-{number}", tool=tool, outcome="ok", ms=1)
    log.close()

    def found(*words: str) -> list[dict[str, Any]]:
        assert main([f"-chdir={tmp_path}", "audit", "-json", *words]) == 0
        records: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["records"]
        assert [record["seq"] for record in records] == sorted(record["seq"] for record in records)
        return records

    planner = found("-client", "PLANNER")
    assert [record["event"] for record in planner] == ["decision", "outcome"] * 4
    assert {record["call"] for record in planner} == {"c-7", "c-107", "c-207", "c-307"}
    assert [record["call"] for record in found("-client", "4107")] == ["c-107", "c-107"]
    assert [record["call"] for record in found("-refused", "-n", "3")] == ["c-257", "c-307", "c-357"]
    assert {record["call"] for record in found("-refused", "-client", "planner")} == {"c-7", "c-107", "c-207", "c-307"}
    assert {record["tool"] for record in found("-tool", "aim", "-n", "20")} == {"aim"}
    assert len(found("-since", "1h", "-n", "9999")) == 800 and found("-since", "2099-01-01T00:00:00Z") == []
    assert main([f"-chdir={tmp_path}", "audit", "-client", "nobody"]) == 0
    assert capsys.readouterr().out == "No record fits.\n"
    assert main([f"-chdir={tmp_path}", "audit", "-since", "yesterday"]) != 0
    assert "'yesterday' is neither a duration nor a time; give a duration back" in capsys.readouterr().err


def test_what_a_stop_did_has_a_line_for_each_device() -> None:
    stopped = [
        {"device": "usb-1", "kind": "tty", "ok": True, "detail": "wrote 3 bytes to /dev/ttyUSB0", "ms": 4.2},
        {"device": "usb-2", "kind": "tty", "ok": False, "detail": "/dev/ttyUSB1: No such file", "ms": 0.1},
    ]
    assert lines({"event": "estop_actions", "by": "anna", "stopped": stopped}) == [
        "     7  2026-05-04T12:00:00Z  estop       done: usb-1: wrote 3 bytes to /dev/ttyUSB0 (4 ms)",
        "                                          FAILED: usb-2: /dev/ttyUSB1: No such file (0 ms)",
    ]


def test_shadow_mode_says_what_would_have_been_refused() -> None:
    found = lines({
        "event": "decision", "tool": "move_rail", "caller": "cell", "decision": "allow", "arguments": {"steps": 5},
        "shadow": ["range: steps is 5, more than 4", "denied: by policy.rules[0]"],
    })  # fmt: skip
    assert [line[42:] for line in found] == [
        "move_rail(steps=5) for cell",
        "would have been refused: range: steps is 5, more than 4",
        "would have been refused: denied: by policy.rules[0]",
    ]


def test_an_emergency_stop_that_came_second_names_the_first() -> None:
    latched = {"by": "anna", "reason": "smoke", "since": "2026-05-04T11:00:00Z"}
    (found,) = lines({"event": "estop", "by": "ben", "reason": "", "latched": latched})
    assert found[42:] == (
        "emergency stop by ben, who gave no reason; engaged already, since 2026-05-04T11:00:00Z by anna"
    )
    (found,) = lines({"event": "estop", "by": "ben", "reason": "hot", "latched": None})
    assert found[42:] == "emergency stop by ben: hot; NOT engaged"


@pytest.mark.parametrize(
    "record", [{"event": "of tomorrow", "colour": "red"}, {"event": "outcome"}, {"event": "estop"}]
)
def test_a_record_of_another_version_is_shown_as_it_stands(record: dict[str, Any]) -> None:
    (found,) = lines(record)
    assert f"  {record['event']}" in found
    assert all(json.loads(json.dumps(value)) in found for name, value in record.items() if name != "event")


def test_nothing_in_a_record_acts_on_the_terminal() -> None:
    (found,) = lines({"event": "estop", "by": "\x1b[1manna", "reason": "smoke\nbench: cleared", "latched": None})
    assert "\x1b" not in found and "\\x1b" in found


def test_every_event_that_the_launcher_writes_has_a_sentence() -> None:
    written = set()
    for path in SERVER.rglob("*.py"):
        text = path.read_text()
        written |= set(re.findall(r"(?:write|_record)\(\s*(?:problems, )?\"(\w+)\"", text))
        written |= set(re.findall(r"\(\(?\"(audit_\w+)\"", text))
    assert {"decision", "estop", "estop_actions", "stuck", "audit_torn"} <= written
    assert written <= set(logs._EVENTS)
