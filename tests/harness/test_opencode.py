"""opencode itself: each API that it speaks, what it gets of the key and the web, and what it costs."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, kept_secret, spec_for
from model_server import serve

from octoform.harness.port import ExitReason, Output, Replying, Task, ToolCalled, Turn, Usage

pytestmark = [pytest.mark.harness, pytest.mark.harness_opencode]
NAME = "opencode"
DONE = {"text": "done"}
COSTS = {"input": 1000, "cached": 400, "output": 50}
APIS = {
    "openai-completions": "chat",
    "openai-responses": "responses",
    "anthropic-messages": "messages",
    "gemini": "gemini",
}


@pytest.mark.parametrize("api", APIS)
def test_work_over_each_api_is_counted_and_the_key_shows_nowhere(
    api: str, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    say = f'echo "<${KEY}>" > seen; '
    with serve({"turns": [{"shell": say + WRITE}, DONE], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server, api=api), task_for())
        assert [request["api"] for request in server.requests] == [APIS[api]] * 2
        assert {request["key"] for request in server.requests} == {SECRET}
        assert "Grüße" in str(server.replies[0]["body"])
    assert ran.outcome.reason is ExitReason.FINISHED, ran.task.log.read_text()[-4000:]
    assert ran.task.output.read_text() == '{"made": true}'
    assert [call.text for call in ran.of(ToolCalled)] == [(say + WRITE).strip()]
    assert "done" in [text.text for text in ran.of(Output)]
    assert ran.of(Turn) == [Turn(Usage(1000, 400, 50))] * 2
    assert ran.of(Replying) == [], "it is for the watcher alone"
    assert (ran.outcome.turns, ran.outcome.usage) == (2, Usage(2000, 800, 100))
    assert (ran.task.workdir / "seen").read_text() == "<>\n", "what it runs has no use for the key"
    assert kept_secret(ran)


def test_a_key_that_the_manifest_shows_the_agent_is_redacted(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": f'echo "<${KEY}>"'}, DONE]) as server:
        ran = run(spec_for(NAME, server, env=(KEY,)), task_for())
    log = ran.task.log.read_text()
    assert f"<[{KEY} redacted]>" in log
    assert SECRET not in log


def test_a_command_without_an_end_is_ended_before_the_run_is(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    endless = "trap '' TERM; sleep 600 & wait; wait"
    with serve([{"shell": endless}, {"shell": WRITE}, DONE]) as server:
        ran = run(spec_for(NAME, server), task_for(idle_seconds=24.0))
        assert "timeout" in str(server.replies[1]["body"])
    assert ran.outcome.reason is ExitReason.FINISHED, ran.task.log.read_text()[-4000:]
    assert ran.task.output.exists()


def test_only_a_manifest_that_allows_it_gives_it_the_web(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    tools = {}
    for allowed in (False, True):
        with serve([DONE]) as server:
            run(spec_for(NAME, server, web_search=allowed), task_for())
            tools[allowed] = set(server.replies[0]["tools"])
    assert tools[True] - tools[False] == {"webfetch", "websearch"}
    assert tools[False] == {"bash", "edit", "glob", "grep", "read", "todowrite", "write"}


def test_a_refused_list_of_models_is_no_matter(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve({"turns": [{"shell": WRITE}, DONE], "models_status": 401}) as server:
        ran = run(spec_for(NAME, server), task_for())
    assert ran.outcome.reason is ExitReason.FINISHED
    assert ran.task.output.exists()


def test_no_key_is_a_matter_of_the_key(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    task = task_for()
    bare = {name: value for name, value in task.environment.items() if name != KEY}
    with serve([{"status": 401}]) as server:
        ran = run(spec_for(NAME, server), replace(task, environment=bare))
        assert [request["key"] for request in server.replies] == [None]
    assert ran.outcome.reason is ExitReason.AUTH
    assert f"not set in the environment: {KEY}" in ran.outcome.detail
