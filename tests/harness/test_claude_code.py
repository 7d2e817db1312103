"""Claude Code itself: what it gets of the key and the web, and what it costs."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, kept_secret, spec_for
from model_server import serve

from octoform.harness.port import Closed, ExitReason, Task, ToolCalled, ToolReturned, Turn, Usage

pytestmark = [pytest.mark.harness, pytest.mark.harness_claude_code]
NAME, MODEL = "claude-code", "anthropic/scripted"
DONE = {"text": "done"}
COSTS = {"input": 1000, "cached": 400, "output": 50}


def test_work_is_counted_and_the_key_shows_nowhere(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    # A program as root could look into its parent; what it runs does not get the key by itself.
    say = f'echo "<$ANTHROPIC_API_KEY${KEY}>" > seen; '
    with serve({"turns": [{"shell": say + WRITE}, DONE], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL))
        assert {request["key"] for request in server.replies} == {SECRET}
    assert ran.outcome.reason is ExitReason.FINISHED
    assert ran.task.output.read_text() == '{"made": true}'
    assert [call.text for call in ran.of(ToolCalled)] == [(say + WRITE).strip()]
    assert ran.of(Closed) == [Closed(ok=True, text="done")]
    assert ran.of(Turn) == [Turn(Usage(1000, 400, 50))] * 2
    assert (ran.outcome.turns, ran.outcome.usage) == (2, Usage(2000, 800, 100))
    assert (ran.task.workdir / "seen").read_text() == "<>\n"
    assert kept_secret(ran)


def test_a_key_that_the_manifest_shows_the_agent_is_redacted(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": 'echo "<$ANTHROPIC_API_KEY>"'}, DONE]) as server:
        ran = run(spec_for(NAME, server, env=(KEY, "ANTHROPIC_API_KEY")), task_for(MODEL))
    log = ran.task.log.read_text()
    assert f"<[{KEY} redacted]>" in log, "the value is known under whatever name it was given"
    assert SECRET not in log


def test_only_a_manifest_that_allows_it_gives_it_the_web(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    tools = {}
    for allowed in (False, True):
        with serve([DONE]) as server:
            run(spec_for(NAME, server, web_search=allowed), task_for(MODEL))
            tools[allowed] = set(server.replies[0]["tools"])
    assert {"WebSearch", "WebFetch"} == tools[True] - tools[False]
    assert {"Bash", "Read", "Write", "Edit"} <= tools[False]


@pytest.mark.patience
def test_a_slow_command_is_told_of_before_the_run_counts_as_idle(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": "echo slow; sleep 300"}, {"shell": WRITE}, DONE]) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL, idle_seconds=8.0))
    assert ran.outcome.reason is ExitReason.FINISHED
    assert [event.failed for event in ran.of(ToolReturned)] == [True, False]
    assert ran.task.output.exists()


def test_the_login_of_a_person_is_the_bearer_and_no_key_is_sent(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    say = 'echo "<$CLAUDE_CODE_OAUTH_TOKEN>" > seen; '
    task = task_for(MODEL)
    task = replace(task, environment={**task.environment, "CLAUDE_CODE_OAUTH_TOKEN": SECRET})
    with serve([{"shell": say + WRITE}, DONE]) as server:
        ran = run(replace(spec_for(NAME, server), key="CLAUDE_CODE_OAUTH_TOKEN", login=True), task)
        assert {request["headers"].get("authorization") for request in server.replies} == {f"Bearer {SECRET}"}
        assert {request["headers"].get("x-api-key") for request in server.replies} == {None}
    assert ran.outcome.reason is ExitReason.FINISHED
    assert (ran.task.workdir / "seen").read_text() == "<>\n"
    assert kept_secret(ran)
