"""The small agent's loop with a model of the test's own making: when it goes on, what it reports, when it ends."""

import io
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from octoform.harness.llm.client import Call, Refusal, Reply
from octoform.harness.llm.route import Route
from octoform.harness.react.agent_tools import Shell, Toolbox
from octoform.harness.react.chat_history import Conversation
from octoform.harness.react.config import Config, read
from octoform.harness.react.loop import MAX_CALLS, MAX_WRONG, SHOWN, Loop, Reporter, instructions

WRITE = "echo {} > output.json"


def shell(command: str) -> Reply:
    return calling(Call("1", "shell", json.dumps({"command": command})))


def calling(*calls: Call) -> Reply:
    return Reply("", calls, usage={"input": 10, "cached": 4, "output": 2})


class Scripted:
    """Answers in order, the last one for ever; keeps what it was asked."""

    def __init__(self, *answers: Reply | Refusal) -> None:
        self.answers = answers
        self.asked: list[list[Mapping[str, Any]]] = []

    def ask(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        assert [item["function"]["name"] for item in tools] == ["shell", "read_file", "write_file", "patch"]
        self.asked.append(list(messages))
        return self.answers[min(len(self.asked), len(self.answers)) - 1]

    def told(self, kind: str) -> list[str]:
        """What the last request holds of messages of one role."""
        return [str(item["content"]) for item in self.asked[-1] if item["role"] == kind]


Ran = tuple[bool, list[dict[str, Any]]]


@pytest.fixture
def run(tmp_path: Path) -> Callable[[Scripted], Ran]:
    """Runs the loop over a scripted model; whether it ended well, and the lines that it wrote."""

    def start(model: Scripted) -> Ran:
        stream = io.StringIO()
        output = tmp_path / "output.json"
        loop = Loop(
            model=model,
            toolbox=Toolbox(tmp_path, Shell(tmp_path, {"PATH": "/usr/bin:/bin"}, 20, 20), {}),
            conversation=Conversation("instructions", "task"),
            reporter=Reporter(stream),
            done=output.is_file,
            output=str(output),
        )
        ended = loop.run()
        return ended, [json.loads(line) for line in stream.getvalue().splitlines()]

    return start


def test_ask_use_append_until_it_is_done(run: Callable[[Scripted], Ran], tmp_path: Path) -> None:
    model = Scripted(shell("echo seen; " + WRITE), Reply("Done."))
    ok, lines = run(model)
    assert ok
    assert (tmp_path / "output.json").read_text() == "{}\n"
    assert lines == [
        {"type": "reply", "text": "", "usage": {"input": 10, "cached": 4, "output": 2}},
        {"type": "call", "tool": "shell", "text": "echo seen; " + WRITE},
        {"type": "result", "failed": False, "text": "seen"},
        {"type": "reply", "text": "Done.", "usage": {}},
        {"type": "closed", "ok": True, "text": ""},
    ]
    assert model.told("tool") == ["seen"]


def test_all_calls_of_a_reply_are_made(run: Callable[[Scripted], Ran]) -> None:
    calls = [Call(str(number), "shell", json.dumps({"command": f"echo {number} >> all"})) for number in range(20)]
    model = Scripted(calling(*calls), shell("cat all; " + WRITE), Reply("Done."))
    ok, _ = run(model)
    assert ok
    assert model.told("tool")[-1].split() == [str(number) for number in range(MAX_CALLS)]
    asked = [call["id"] for item in model.asked[-1] for call in item.get("tool_calls", ())]
    assert asked == [item["tool_call_id"] for item in model.asked[-1] if item["role"] == "tool"]


def test_words_without_the_file_are_answered_once(run: Callable[[Scripted], Ran], tmp_path: Path) -> None:
    model = Scripted(Reply("All is well."), Reply("Really."))
    ok, lines = run(model)
    assert ok, "the end is its own; that there is no output is the gate's to say"
    assert len(model.asked) == 2
    assert model.told("user")[-1].startswith(f"The output file {tmp_path / 'output.json'} is not there")
    assert lines[-1] == {"type": "closed", "ok": True, "text": ""}


def test_a_model_that_is_reminded_writes_the_file(run: Callable[[Scripted], Ran]) -> None:
    assert run(Scripted(Reply("Done?"), shell(WRITE), Reply("Now.")))[0]


@pytest.mark.parametrize(
    "wrong",
    [
        calling(Call("1", "no_such_tool", "{}")),
        calling(Call("1", "shell", '{"command": "echo')),
        calling(Call("1", "shell", "{}")),
        calling(Call("1", "", "")),
        Reply(""),
    ],
)
def test_nothing_that_can_be_run_is_bounded(run: Callable[[Scripted], Ran], wrong: Reply) -> None:
    model = Scripted(wrong)
    ok, lines = run(model)
    assert not ok
    assert len(model.asked) == MAX_WRONG
    assert lines[-1]["type"] == "closed" and not lines[-1]["ok"]
    assert "with which nothing could be done" in lines[-1]["text"]


def test_a_good_call_between_bad_ones_starts_the_count_anew(run: Callable[[Scripted], Ran]) -> None:
    wrong = [calling(Call("1", "shell", "{}"))] * (MAX_WRONG - 1)
    ok, lines = run(Scripted(*wrong, shell("true"), *wrong, shell(WRITE), Reply("Done.")))
    assert ok
    assert sum(line.get("failed", False) for line in lines) == 2 * (MAX_WRONG - 1)


def test_a_model_that_has_failed_for_good(run: Callable[[Scripted], Ran]) -> None:
    ok, lines = run(Scripted(Refusal("no such model", 404)))
    assert not ok
    assert lines == [{"type": "closed", "ok": False, "text": "no such model"}]


def test_a_conversation_that_the_model_finds_too_long(run: Callable[[Scripted], Ran]) -> None:
    model = Scripted(shell("true"), Refusal("too long", 400, too_long=True), shell(WRITE), Reply("Done."))
    assert run(model)[0]
    model = Scripted(Refusal("too long", 400, too_long=True))
    ok, lines = run(model)
    assert not ok
    assert [line["type"] for line in lines] == ["trouble", "closed"]


def test_what_is_written_is_bounded_and_one_line_each(run: Callable[[Scripted], Ran]) -> None:
    text = "a\nb\u2028" * 10_000
    model = Scripted(
        Reply(text, (Call("1", "shell", json.dumps({"command": f"yes | head -c 90000; {WRITE}"})),)), Reply("ok")
    )
    ok, lines = run(model)
    assert ok
    assert [len(line["text"]) for line in lines if line["type"] in ("reply", "result")][:2] == [SHOWN, SHOWN]


def test_the_configuration_comes_back_as_it_was_written(tmp_path: Path) -> None:
    config = Config(
        route=Route("openai/x", "http://127.0.0.1/v1", "LOOP_KEY"),
        prompt="/a/prompt.md",
        output="/a/output.json",
        workdir="/a",
        request_seconds=10.0,
        shell_seconds=5,
        most_shell_seconds=9,
        backoff_seconds=0.1,
        hidden=["LOOP_KEY"],
    )
    config.write(tmp_path / "config.json")
    assert read(tmp_path / "config.json") == config
    text = instructions(config)
    assert "/a/output.json" in text and "up to 9 with" in text and "$" not in text
