"""Codex itself: what it gets of the key and the web, and what it costs."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, kept_secret, spec_for
from model_server import serve

from octoform.harness.port import Closed, ExitReason, ModelProblem, Task, ToolCalled, Turn, Usage

pytestmark = [pytest.mark.harness, pytest.mark.harness_codex]
NAME, MODEL = "codex", "openai/scripted"
DONE = {"text": "done"}
COSTS = {"input": 1000, "cached": 400, "output": 50}


def test_work_is_counted_and_the_key_shows_nowhere(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    # A program as root could look into its parent; what it runs does not get the key by itself.
    say = f'echo "<${KEY}>" > seen; echo "$PATH" > path; '
    with serve({"turns": [{"shell": say + WRITE}, DONE], "usage": COSTS}) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL))
        assert {request["key"] for request in server.replies} == {SECRET}
    assert ran.outcome.reason is ExitReason.FINISHED
    assert ran.task.output.read_text() == '{"made": true}'
    assert [call.text for call in ran.of(ToolCalled)] == [(say + WRITE).strip()]
    assert ran.of(Closed) == [Closed(ok=True)]
    assert ran.of(Turn) == [Turn(Usage(1000, 400, 50))] * 2
    assert (ran.outcome.turns, ran.outcome.usage) == (2, Usage(2000, 800, 100))
    assert (ran.task.workdir / "seen").read_text() == "<>\n"
    assert ran.task.environment["PATH"] in (ran.task.workdir / "path").read_text(), "no login shell sets another"
    assert kept_secret(ran)


def test_a_key_that_the_manifest_shows_the_agent_is_redacted(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": f'echo "<${KEY}>"'}, DONE]) as server:
        ran = run(spec_for(NAME, server, env=(KEY,)), task_for(MODEL))
    log = ran.task.log.read_text()
    assert f"<[{KEY} redacted]>" in log
    assert SECRET not in log


def test_only_a_manifest_that_allows_it_gives_it_the_web(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    tools = {}
    for allowed in (False, True):
        with serve([DONE]) as server:
            run(spec_for(NAME, server, web_search=allowed), task_for(MODEL))
            tools[allowed] = set(server.replies[0]["tools"])
    assert {"web_search"} == tools[True] - tools[False]
    assert "exec_command" in tools[False]


def test_a_failed_request_is_told_of_with_its_status_and_at_once(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    with serve([{"shell": "true"}, {**DONE, "fail_first": [{"status": 500}]}]) as server:
        ran = run(spec_for(NAME, server), task_for(MODEL))
    assert ran.outcome.reason is ExitReason.FINISHED
    assert ran.of(ModelProblem) == [ModelProblem(ExitReason.UNREACHABLE, "HTTP status 500")]


def test_the_login_of_a_person_is_sent_with_the_account_that_it_is_of(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for(MODEL)
    login = {"CODEX_ACCESS_TOKEN": SECRET, "CODEX_ACCOUNT_ID": "account-7"}
    task = replace(task, environment={**task.environment, **login})
    say = 'echo "<$CODEX_ACCESS_TOKEN>" > seen; '
    with serve([{"shell": say + WRITE}, DONE]) as server:
        ran = run(replace(spec_for(NAME, server), key="CODEX_ACCESS_TOKEN", login=True), task)
        assert {request["headers"].get("authorization") for request in server.replies} == {f"Bearer {SECRET}"}
        assert {request["headers"].get("chatgpt-account-id") for request in server.replies} == {"account-7"}
    assert ran.outcome.reason is ExitReason.FINISHED
    assert (ran.task.workdir / "seen").read_text() == "<>\n"
    assert kept_secret(ran)
