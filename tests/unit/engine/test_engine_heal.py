"""What HEAL wants done by others is done once its agent has ended, and a redeploy is nothing but that."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from octoform.apply.repair_outcome import Cost, RepairOutcome
from octoform.endpoint.process import record
from octoform.endpoint.process.estop import LATCH
from octoform.engine.plan.plan import Outlook
from octoform.engine.unattended import heal, rediscover
from octoform.state.layout import Layout

LAYOUT = Layout(Path("/nowhere"), "bench")


def asked(action: str | None, *, ok: bool = True) -> RepairOutcome:
    report = {"status": "repaired", "action": action}
    made = RepairOutcome.done if ok else RepairOutcome.failed
    return made("heal.action", "why", report=report, cost=Cost(1, 3, 4, 0.5))


@pytest.mark.parametrize("action", ["restore", "redeploy", "restart", "rediscover"])
def test_an_action_is_carried_out_and_both_are_told_and_paid(monkeypatch: pytest.MonkeyPatch, action: str) -> None:
    done = RepairOutcome.failed("x.y", "it went wrong", again=False, cost=Cost(2, 1, 1, 0.25))
    monkeypatch.setattr(heal, "run_task", lambda *_: asked(action))
    monkeypatch.setattr(heal, "layout_of", lambda *_: (LAYOUT, []))
    monkeypatch.setattr(heal, "ACTIONS", {**heal.ACTIONS, action: lambda layout, environ, left: done})
    found = heal.heal(Path("/nowhere"), {}, {})
    assert (found.ok, found.again, found.detail) == (False, False, "it went wrong; why")
    assert found.cost == Cost(3, 4, 5, 0.75)
    assert found.report is not None and found.report["action"] == action


def test_every_action_of_the_contract_but_a_rewrite_and_none_has_its_way() -> None:
    from octoform.contracts.rules.heal_rules import ACTIONS

    named = {action for actions in ACTIONS.values() for action in actions}
    assert named - {"rewrite"} == set(heal.ACTIONS)


@pytest.mark.parametrize("answer", [asked("rewrite"), asked(None), asked("restore", ok=False)])
def test_nothing_more_is_done_after_a_rewrite_or_a_failure(
    monkeypatch: pytest.MonkeyPatch, answer: RepairOutcome
) -> None:
    def never(*_: object) -> RepairOutcome:
        raise AssertionError("nothing is to be done")

    monkeypatch.setattr(heal, "run_task", lambda *_: answer)
    monkeypatch.setattr(heal, "layout_of", lambda *_: (LAYOUT, []))
    monkeypatch.setattr(heal, "ACTIONS", dict.fromkeys(heal.ACTIONS, never))
    assert heal.heal(Path("/nowhere"), {}, {}) == answer


def test_nothing_is_carried_out_behind_an_emergency_stop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> RepairOutcome:
        raise AssertionError("nothing is to be done")

    layout = Layout(tmp_path, "bench")
    layout.run.mkdir(parents=True)
    (layout.run / LATCH).write_text("{}")
    monkeypatch.setattr(heal, "run_task", lambda *_: asked("restart"))
    monkeypatch.setattr(heal, "layout_of", lambda *_: (layout, []))
    monkeypatch.setattr(heal, "ACTIONS", dict.fromkeys(heal.ACTIONS, never))
    found = heal.heal(tmp_path, {}, {})
    assert (found.ok, found.again, found.cost) == (False, True, Cost(1, 3, 4, 0.5))


def outlook(*work: str, host: str = "bench", steps: tuple[Any, ...] = ()) -> Outlook:
    plan = SimpleNamespace(work=[SimpleNamespace(node=name) for name in work], steps=steps)
    compiled = SimpleNamespace(layout=Layout(Path("/nowhere"), host))
    return cast(Outlook, SimpleNamespace(plan=plan, compiled=compiled, snapshot=None))


def test_a_redeploy_consents_to_nothing_but_the_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rediscover, "remember", lambda layout, snapshot: cast(Any, "all of it"))
    monkeypatch.setattr(rediscover, "keep", lambda former: None)

    def consent(plan: Outlook) -> tuple[bool, str]:
        mine = rediscover._RedeployConsent(LAYOUT)
        return mine(plan), mine.why

    picture = SimpleNamespace(node="step.perceive", kind="frame", skipped=None)
    arm = SimpleNamespace(node="step.arm", kind="reading", skipped=None)
    idle = SimpleNamespace(node="step.rail", kind="view", skipped="there is none")
    assert consent(outlook("deploy", "endpoint")) == (True, "")
    assert consent(outlook("deploy", "endpoint", "step.perceive", "step.rail", steps=(picture, idle)))[0]
    for plan in (outlook("probe", "deploy"), outlook("deploy", "step.arm", steps=(arm,)), outlook("deploy", host="x")):
        found, why = consent(plan)
        assert not found and why
    monkeypatch.setattr(rediscover, "remember", lambda layout, snapshot: None)
    assert consent(outlook("deploy")) == (False, "the host is not as it was applied")


@pytest.mark.parametrize("left", ["candidate", "adopting.json", None])
def test_what_a_killed_repair_has_left_is_settled_and_nothing_is_done_otherwise(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, left: str | None
) -> None:
    layout = Layout(tmp_path, "bench")
    layout.local.mkdir(parents=True)
    if left == "candidate":
        (layout.local / left).mkdir()
    elif left is not None:
        (layout.local / left).write_text("{}")
    monkeypatch.setattr(heal, "run_task", lambda *_: asked(None))
    found = heal.settle(layout, {})
    assert found == (asked(None) if left else None)
    assert record.mark(layout) is None
    assert heal.settle(layout, {}) is None, "it would start what a person has stopped"
