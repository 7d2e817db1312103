"""What holds for every program alike: money is counted while it works, and a missing key is a matter of the key."""

from collections.abc import Callable
from dataclasses import replace

import pytest
from agent_runs import KEY, Ran, spec_for
from harness.matrix import PROGRAMS, Subject
from model_server import serve

from octoform.harness.port import ExitReason, Price, Task

COSTS = {"input": 1000, "cached": 400, "output": 50}
ASKING_ANYWAY = ("opencode",)
"""Programs that ask their model without a key as well: what it answers decides."""


@pytest.mark.parametrize("subject", PROGRAMS)
def test_money_is_counted_while_it_works(
    subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    price = Price(input=100.0, cached=10.0, output=1000.0, source="manifest")
    with serve({"turns": [{"shell": "echo {turn}"}], "usage": COSTS}) as server:
        ran = run(spec_for(subject.name, server), replace(task_for(subject.model, usd=0.3), price=price))
    assert ran.outcome.reason is ExitReason.BUDGET
    assert ran.outcome.usage.cost_usd is not None
    # A reply costs 0.114 dollars; a few more may come before the program is ended.
    assert 0.3 < ran.outcome.usage.cost_usd < 1.5


@pytest.mark.parametrize("subject", [item for item in PROGRAMS if item.id not in ASKING_ANYWAY])
def test_no_key_is_a_matter_of_the_key(
    subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for(subject.model)
    bare = {name: value for name, value in task.environment.items() if name != KEY}
    with serve([{"text": "done"}]) as server:
        ran = run(spec_for(subject.name, server), replace(task, environment=bare))
    assert ran.outcome.reason is ExitReason.AUTH
    assert not server.replies
