"""An unattended run is begun only where what the hour has left is enough for all of it."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from octoform.apply.repair_outcome import Cost
from octoform.engine.results import RunResult, RunUsage
from octoform.engine.unattended.rediscover import Left, _Consent, _cost, shortages
from octoform.graph.model import Graph
from octoform.manifest.model import Budget, Escalation, HarnessSpec, StageSettings
from octoform.plan.model import Action, Cause, Plan, PlannedAction, Reason
from octoform.state.layout import Layout
from octoform.state.model import Snapshot

FREE = StageSettings(HarnessSpec("builtin"), None, Budget(3, 60.0, 60.0, 10))
PAID = StageSettings(HarnessSpec("claude-code"), "m", Budget(3, 60.0, 60.0, 10, usd=0.5))
CHANGED = Reason(Cause.CHANGED, part="hardware", before="a", after="b")
STAGES = ("probe", "identify", "interface", "serve")


def outlook(settings: StageSettings, run_usd: float | None = None, **more: StageSettings) -> Any:
    """A plan that makes every stage again."""
    of = {**dict.fromkeys(STAGES, settings), **more}
    asks = {name: each.harness.name != "builtin" or each.escalate is not None for name, each in of.items()}
    work = [
        PlannedAction(name, Action.UPDATE, True, (CHANGED,), calls_agent=True, calls_model=asks[name])
        for name in STAGES
    ]
    manifest = SimpleNamespace(
        settings_of=of.__getitem__, budget_for=lambda name: of[name].budget, run_usd=run_usd, lifecycle=None
    )
    endpoint = PlannedAction("endpoint", Action.UPDATE, True, (CHANGED,))
    return SimpleNamespace(
        plan=Plan("bench", "apply", (*work, endpoint)),
        snapshot=Snapshot(octoform="0", host="bench", lineage="l"),
        compiled=SimpleNamespace(manifest=manifest, layout=SimpleNamespace(host="bench"), graph=Graph(())),
    )


@pytest.mark.parametrize(
    ("settings", "most"),
    [
        (FREE, 5),
        (PAID, 15),
        (replace(FREE, escalate=Escalation(PAID.harness, "m")), 20),
    ],
)
def test_all_attempts_of_all_stages_have_to_fit_and_serves_second_round(settings: StageSettings, most: int) -> None:
    assert shortages(outlook(settings), Left(calls=most)) == ()
    (why,) = shortages(outlook(settings), Left(calls=most - 1))
    assert why == f"it may take {most} agent runs and the hour has {most - 1} left (daemon.calls_per_hour)"
    assert shortages(outlook(settings), Left()) == (), "nobody counts"


def test_dollars_are_bounded_by_the_budgets_and_what_has_no_bound_is_not_begun() -> None:
    assert shortages(outlook(PAID), Left(usd=2.0)) == ()
    assert "may cost 2.00 US dollars and the hour has 1.90" in shortages(outlook(PAID), Left(usd=1.9))[0]
    assert shortages(outlook(PAID, run_usd=1.0), Left(usd=1.9)) == ()
    unbounded = replace(PAID, budget=replace(PAID.budget, usd=None))
    assert "no bound" in shortages(outlook(PAID, probe=unbounded), Left(usd=100.0))[0]
    assert shortages(outlook(PAID, run_usd=1.0, probe=unbounded), Left(usd=1.0)) == ()
    assert shortages(outlook(FREE), Left(usd=0.0)) == (), "the embedded agent costs nothing"


def test_what_is_left_is_what_was_told_less_what_was_spent_since() -> None:
    assert Left.of({}) == Left()
    assert Left.of({"calls": 4, "usd": 1.0}) == Left(4, 1.0)
    assert Left.of({"calls": 4, "usd": 1.0}, 3, 0.25) == Left(1, 0.75)
    assert Left.of({"calls": 1, "usd": 1.0}, 3, None) == Left(0, 0.0)


def test_a_run_that_would_pass_a_cap_is_asked_about_and_not_begun(tmp_path: Any) -> None:
    consent = _Consent(Layout(tmp_path, "bench"), "auto", Left(calls=4))
    assert consent(outlook(FREE)) is False
    assert consent.answer is not None and consent.former is None
    assert (consent.answer.ok, consent.answer.again, consent.answer.asked) == (False, False, True)
    assert "the hour has 4 left (daemon.calls_per_hour)" in consent.answer.detail


def test_what_no_model_did_costs_nothing_and_what_is_not_known_stays_so() -> None:
    result = RunResult("apply", "bench", agent_runs=4)
    assert _cost(result, free=True).usd == 0.0
    assert _cost(result, free=False).usd is None
    priced = replace(result, usage=RunUsage(cost_usd=0.4))
    assert _cost(priced, free=True) == Cost(4, 0, 0, 0.4)
