"""Calls as models write them, good and bad; and what a tool's answer does not hold."""

import json
from pathlib import Path
from typing import Any

import pytest

from octoform.harness.llm.client import Call
from octoform.harness.react.agent_tools import Ready, Shell, Toolbox, checked, declared

SECRET = "loop-3f9a77c1d2e4"


def call(name: str, arguments: object) -> Call:
    return Call("1", name, arguments if isinstance(arguments, str) else json.dumps(arguments))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("shell", {"command": "ls"}),
        ("shell", {"command": "ls", "timeout_seconds": 5, "why": "because"}),
        ("shell", {"command": "ls", "timeout_seconds": None}),
        ("read_file", {"path": "a", "offset": 2, "limit": 3}),
        ("write_file", {"path": "a", "content": ""}),
        ("patch", {"path": "a", "edits": [{"old": "x", "new": "y"}]}),
    ],
)
def test_a_good_call(name: str, arguments: dict[str, Any]) -> None:
    assert checked(call(name, arguments)) == Ready(name, arguments)


@pytest.mark.parametrize(
    ("name", "arguments", "told"),
    [
        (
            "no_such_tool",
            {"x": 1},
            "there is no tool 'no_such_tool'; the tools are shell, read_file, write_file, patch",
        ),
        ("", {}, "there is no tool ''"),
        ("shell", '{"command": "echo hi', 'the arguments are no JSON object: \'{"command": "echo hi\''),
        ("shell", "[1]", "the arguments are no JSON object"),
        ("shell", "[" * 100_000, "the arguments have more than"),
        ("shell", "[" * 20_000, "the arguments are no JSON object"),
        ("shell", "", "command is missing; shell takes"),
        ("shell", {}, "command is missing; shell takes"),
        ("shell", {"command": ["ls"]}, "command is no string"),
        ("shell", {"command": "ls", "timeout_seconds": "5"}, "timeout_seconds is no integer"),
        ("shell", {"command": "ls", "timeout_seconds": True}, "timeout_seconds is no integer"),
        ("shell", {"command": None}, "command is missing"),
        ("patch", {"path": "a", "edits": {"old": "x", "new": "y"}}, "edits is no array"),
        ("patch", {"path": "a", "edits": ["x"]}, "edits[0] is no object"),
        ("patch", {"path": "a", "edits": [{"old": "x", "new": "y"}, {"old": "x"}]}, "edits[1].new is missing"),
        ("patch", {"path": "a", "edits": [{"old": 1, "new": "y"}]}, "edits[0].old is no string"),
    ],
)
def test_a_bad_call_is_told_what_is_wrong(name: str, arguments: object, told: str) -> None:
    answer = checked(call(name, arguments))
    assert isinstance(answer, str)
    assert answer.startswith(told)
    assert len(answer) < 2000


@pytest.fixture
def toolbox(tmp_path: Path) -> Toolbox:
    return Toolbox(tmp_path, Shell(tmp_path, {"PATH": "/usr/bin:/bin"}, 20, 20), {"LOOP_KEY": SECRET})


def test_every_tool_does_its_work(toolbox: Toolbox, tmp_path: Path) -> None:
    used = [
        toolbox.use(Ready("write_file", {"path": "a", "content": "one\n"})),
        toolbox.use(Ready("patch", {"path": "a", "edits": [{"old": "one", "new": "two"}]})),
        toolbox.use(Ready("shell", {"command": "cat a", "timeout_seconds": None, "why": "to see"})),
        toolbox.use(Ready("read_file", {"path": "a"})),
    ]
    assert [text.failed for text in used] == [False] * 4
    assert (used[2].text, used[3].text) == ("two", "two\n")
    assert {item["function"]["name"] for item in declared()} == {"shell", "write_file", "patch", "read_file"}


def test_a_secret_that_a_tool_comes_upon_reaches_no_model(toolbox: Toolbox, tmp_path: Path) -> None:
    (tmp_path / "found").write_text(f"key={SECRET}\n")
    for ready in (Ready("read_file", {"path": "found"}), Ready("shell", {"command": "cat found"})):
        found = toolbox.use(ready).text
        assert SECRET not in found
        assert "LOOP_KEY" in found


def test_a_call_says_what_it_is_about() -> None:
    assert Ready("shell", {"command": "ls"}).text == "ls"
    assert Ready("read_file", {"path": "a"}).text == "a"
