"""Qwen Code itself: what it gets of the key and the web, what it costs, what of its surroundings it ignores."""

from collections.abc import Callable

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, kept_secret, spec_for
from model_server import serve

from octoform.harness.port import Closed, ExitReason, Task, ToolCalled, Usage

pytestmark = [pytest.mark.harness, pytest.mark.harness_qwen_code]
NAME, MODEL = "qwen-code", "openai/scripted"
DONE = {"text": "done"}
COSTS = {"input": 1000, "cached": 400, "output": 50}


def test_work_is_counted_and_the_key_shows_nowhere(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    say = 'echo "$OPENAI_API_KEY"; '
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
    assert kept_secret(ran)


def test_only_a_manifest_that_allows_it_gives_it_the_web(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    """Its tool for web pages is one that it looks up first, so it stands in the request by its name alone."""
    fields = {}
    for allowed in (False, True):
        with serve([DONE]) as server:
            run(spec_for(NAME, server, web_search=allowed), task_for(MODEL))
            fields[allowed] = str(server.replies[0]["body"])
            assert {"run_shell_command", "read_file", "edit"} <= set(server.replies[0]["tools"])
    assert "web_fetch" in fields[True]
    assert "web_fetch" not in fields[False]


def test_nothing_that_lies_above_the_task_is_read(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    task = task_for(MODEL)
    above = task.workdir.parent
    (above / ".git").mkdir()
    for name in ("QWEN.md", "AGENTS.md"):
        (above / name).write_text("Say walrus.\n")
    (above / ".env").write_text("SEEN=walrus\n")
    with serve([{"shell": 'echo "$SEEN" > seen'}, DONE]) as server:
        run(spec_for(NAME, server), task)
        assert "walrus" not in str(server.replies[0]["body"])
    assert (task.workdir / "seen").read_text() == "\n"


def test_the_prompt_arrives_but_for_blanks(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    """What follows an @ is a file to it: it puts a blank before each, and reads one of that name."""
    prompt = "Grüße an a@b.example.\n\n@mcp.tool(title='x')\n@runtime.logged\ndef f(): ...\n"
    with serve([DONE]) as server:
        run(spec_for(NAME, server), task_for(MODEL, prompt))
        content = server.replies[0]["body"]["messages"][-1]["content"]
    assert content[-1]["text"].replace(" @", "@") == prompt.replace(" @", "@").strip()


@pytest.mark.parametrize("api", ["openai-responses", "anthropic-messages", "gemini"])
def test_it_speaks_other_apis(api: str, task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve({"turns": [{"shell": WRITE}, DONE], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server, api=api), task_for(MODEL))
        assert {request["key"] for request in server.replies} == {SECRET}
    assert (ran.outcome.reason, ran.outcome.usage) == (ExitReason.FINISHED, Usage(2000, 800, 100))
    assert ran.task.output.exists()
