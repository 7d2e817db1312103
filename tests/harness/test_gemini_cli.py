"""Gemini CLI itself: what it gets of the key and the web, what it costs, what of its surroundings it ignores."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, spec_for
from model_server import serve

from octoform.harness.port import Closed, ExitReason, Price, Task, ToolCalled, Usage

pytestmark = [pytest.mark.harness, pytest.mark.harness_gemini_cli]
NAME, MODEL = "gemini-cli", "gemini/scripted"
DONE = {"text": "done"}
COSTS = {"input": 1000, "cached": 400, "output": 50}


def test_work_is_counted_and_the_key_shows_nowhere(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    say = 'echo "$GEMINI_API_KEY"; '
    with serve({"turns": [{"shell": say + WRITE}, DONE], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL))
        assert {request["key"] for request in server.replies} == {SECRET}
        assert len(server.replies) == 2, "nothing is asked beside the conversation"
    assert ran.outcome.reason is ExitReason.FINISHED
    assert ran.task.output.read_text() == '{"made": true}'
    assert [call.text for call in ran.of(ToolCalled)] == [(say + WRITE).strip()]
    assert ran.of(Closed) == [Closed(ok=True)]
    assert (ran.outcome.turns, ran.outcome.usage) == (2, Usage(2000, 800, 100))
    assert f"[{KEY} redacted]" in ran.task.log.read_text(), "the value is known under whatever name it was given"
    holding = [path for path in ran.task.workdir.rglob("*") if path.is_file() and SECRET.encode() in path.read_bytes()]
    assert holding == []


def test_money_is_counted_while_it_works(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    price = Price(input=100.0, cached=10.0, output=1000.0, source="manifest")
    with serve({"turns": [{"shell": "echo {turn}"}], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server), replace(task_for(MODEL, usd=0.3), price=price))
    assert ran.outcome.reason is ExitReason.BUDGET
    assert ran.outcome.usage.cost_usd is not None
    # A reply costs 0.114 dollars; a few more may come before the program is ended.
    assert 0.3 < ran.outcome.usage.cost_usd < 1.5


def test_only_a_manifest_that_allows_it_gives_it_the_web(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    tools = {}
    for allowed in (False, True):
        with serve([DONE]) as server:
            run(spec_for(NAME, server, web_search=allowed), task_for(MODEL))
            tools[allowed] = set(server.replies[0]["tools"])
    assert {"google_web_search", "web_fetch"} == tools[True] - tools[False]
    assert {"run_shell_command", "read_file", "write_file"} <= tools[False]


def test_nothing_that_lies_above_the_task_is_read(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    task = task_for(MODEL)
    above = task.workdir.parent
    (above / ".git").mkdir()
    for name in ("GEMINI.md", "AGENTS.md"):
        (above / name).write_text("Say walrus.\n")
    (above / ".env").write_text("SEEN=walrus\n")
    with serve([{"shell": 'echo "$SEEN" > seen'}, DONE]) as server:
        run(spec_for(NAME, server), task)
        assert "walrus" not in str(server.replies[0]["body"])
    assert (task.workdir / "seen").read_text() == "\n"


def test_the_prompt_arrives_as_it_is(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    """What follows an @ is a file to it, if there is one of that name."""
    prompt = "Grüße an a@b.example.\n\n@mcp.tool(title='x')\n@runtime.logged\ndef f(): ...\n"
    task = task_for(MODEL, prompt)
    (task.workdir / "old").mkdir()
    (task.workdir / "old" / "mcp.tool.md").write_text("walrus\n")
    with serve([DONE]) as server:
        run(spec_for(NAME, server), task)
        contents = server.replies[0]["body"]["contents"]
    assert contents[-1]["parts"][-1]["text"] == prompt


def test_a_run_that_polls_is_no_loop(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve([*[{"shell": "true"}] * 8, {"shell": WRITE}, DONE]) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL))
    assert (ran.outcome.reason, ran.outcome.turns) == (ExitReason.FINISHED, 10)
    assert ran.task.output.exists()


def test_no_key_is_a_matter_of_the_key(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    task = task_for(MODEL)
    bare = {name: value for name, value in task.environment.items() if name != KEY}
    with serve([DONE]) as server:
        ran = run(spec_for(NAME, server), replace(task, environment=bare))
    assert ran.outcome.reason is ExitReason.AUTH
    assert not server.replies


def test_a_command_without_an_end_is_ended_and_the_run_goes_on(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": "sleep 600"}, {"shell": WRITE}, DONE]) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL, idle_seconds=8.0))
    assert (ran.outcome.reason, ran.outcome.turns) == (ExitReason.FINISHED, 3)
    assert ran.task.output.exists()
