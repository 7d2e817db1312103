"""octoform's own small agent as a process, at work and below containment.

What it does in each failure stands in the table of `test_failures`; its loop and tools are tried in
tests/unit/harness without a process.
"""

import json
from collections.abc import Callable
from dataclasses import astuple, replace

import pytest
from agent_runs import KEY, SECRET, WRITE, Ran, spec_for
from model_server import serve

from octoform.harness.port import Closed, ExitReason, Output, Price, Task, ToolCalled, ToolReturned, Turn, Usage

DONE = {"text": "done"}


def test_its_work_its_usage_and_what_its_commands_do_not_get(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    environ = {"PASSED": "proxy-91c2d7", "PASSED_TOKEN": "t-91c2d7-0123", "LANG": "de_DE"}
    task = task_for()
    task = replace(task, environment={**task.environment, **environ}, price=Price(1.0, 0.1, 2.0, "manifest"))
    script = {
        "turns": [{"shell": f"env > seen; cat task.json; {WRITE}", "text": "I write it."}, DONE],
        "usage": {"input": 1000, "cached": 400, "output": 50},
    }
    with serve(script) as server:
        ran = run(spec_for("litellm", server, env=("PASSED", "PASSED_TOKEN")), task)
        asked = server.replies
    outcome = ran.outcome
    assert (outcome.reason, outcome.exit_status, outcome.turns) == (ExitReason.FINISHED, 0, 2), task.log.read_text()
    assert astuple(outcome.usage) == (2000, 800, 100, pytest.approx((1200 + 80 + 200) / 1e6), "manifest")
    assert (outcome.program or "").startswith("litellm 1.")
    assert task.output.read_text() == '{"made": true}'
    lines = [json.loads(line) for line in task.transcript.read_text().splitlines()]
    assert [item["text"] for item in lines if item["event"] == "said"] == ["I write it.", "done"]
    assert [event for event in ran.events if not isinstance(event, Output)] == [
        Turn(Usage(1000, 400, 50)),
        ToolCalled("shell", f"env > seen; cat task.json; {WRITE}".strip()),
        ToolReturned(),
        Turn(Usage(1000, 400, 50)),
        Closed(ok=True),
    ]
    assert [item["key"] for item in asked] == [SECRET] * 2
    assert set(asked[0]["tools"]) == {"shell", "read_file", "write_file", "patch"}
    seen = dict(line.split("=", 1) for line in (task.workdir / "seen").read_text().splitlines())
    assert not {KEY, "PASSED_TOKEN", "LITELLM_LOCAL_MODEL_COST_MAP"} & set(seen)
    assert seen["PASSED"] == "proxy-91c2d7", "a proxy, say, is there for its commands as well"
    assert (seen["OCTOFORM_OUTPUT"], seen["LANG"]) == (str(task.output), "C.UTF-8")
    for path in task.workdir.rglob("*"):
        assert not path.is_file() or SECRET.encode() not in path.read_bytes(), path


def test_a_key_that_is_not_set_is_said_before_the_library_is_even_imported(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for()
    task = replace(task, environment={name: value for name, value in task.environment.items() if name != KEY})
    with serve([DONE]) as server:
        ran = run(spec_for("litellm", server), task)
        assert server.requests == []
    assert ran.outcome.reason is ExitReason.AUTH
    assert f"the variable {KEY} with the API key is not set" in ran.outcome.detail


def test_its_commands_find_the_key_in_no_process_of_the_attempt(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for()
    task = replace(task, environment={**task.environment, "OTHER_TOKEN": "t-91c2d7-0123"})
    above = "cat /proc/$PPID/environ > seen; cat /proc/$(ps -o ppid= -p $PPID | tr -d ' ')/environ >> seen; "
    again = "timeout 2 cat /proc/$PPID/fd/0 >> seen; "
    with serve([{"shell": above + again + WRITE}, DONE]) as server:
        ran = run(spec_for("litellm", server, env=("OTHER_TOKEN",)), task)
        assert [item["key"] for item in server.replies] == [SECRET] * 2
    assert ran.outcome.reason is ExitReason.FINISHED, task.log.read_text()
    seen = (task.workdir / "seen").read_text()
    # The process itself, and its supervisor where that is no other user's: root's agent is the user nobody in its
    # sandbox.
    assert 1 <= seen.count("OCTOFORM_ATTEMPT=") <= 2
    assert SECRET not in seen
    assert "t-91c2d7-0123" not in seen


@pytest.mark.harness
@pytest.mark.harness_litellm
@pytest.mark.parametrize("model", ["anthropic/scripted", "gemini/scripted", "ollama/scripted", "openrouter/a/scripted"])
def test_over_every_api(model: str, task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve([{"shell": WRITE}, DONE]) as server:
        ran = run(spec_for("litellm", server), task_for(model))
    assert (ran.outcome.reason, ran.outcome.turns) == (ExitReason.FINISHED, 2), ran.task.log.read_text()
    assert ran.task.output.exists()


@pytest.mark.harness
@pytest.mark.harness_litellm
def test_a_long_run_of_large_results_sends_no_ever_larger_request(
    task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    flood = {"shell": "yes 'of {turn} {turn} {turn}' | head -c 40000"}
    with serve([*[flood] * 40, {"shell": WRITE}, DONE]) as server:
        ran = run(spec_for("litellm", server), task_for(turns=60))
        sizes = [len(str(item["body"])) for item in server.replies]
    assert ran.outcome.reason is ExitReason.FINISHED, ran.task.log.read_text()[-2000:]
    assert ran.task.output.exists()
    assert max(sizes) < 400_000 < sum(sizes)


@pytest.mark.harness
@pytest.mark.harness_litellm
def test_nothing_that_can_be_run_ends_as_crashed(task_for: Callable[..., Task], run: Callable[..., Ran]) -> None:
    with serve([{"malformed": "unknown_tool"}]) as server:
        ran = run(spec_for("litellm", server), task_for())
    assert (ran.outcome.reason, ran.outcome.turns) == (ExitReason.CRASHED, 5)
    assert "with which nothing could be done" in ran.outcome.detail
