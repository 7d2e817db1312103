"""Saved plans: exactly the units that moved are refused, by part; and a plan survives its own JSON."""

from unit.plan.settled_graph import FILES, FINGERPRINT, GRAPH, OUTPUTS, observed, settled

from octoform.plan.diff import Observed, Prior, Wishes, diff
from octoform.plan.model import (
    Action,
    Change,
    NamedDevice,
    NearProfile,
    OpenQuestion,
    Plan,
    ProfileUse,
    from_json,
    to_json,
)
from octoform.plan.planfile import PlanFile, applicable, describe, moved, read, units


def saved(prior: dict[str, Prior], seen: Observed, **wishes: frozenset[str]) -> PlanFile:
    plan = Plan("bench", "apply", diff(GRAPH, prior, seen, Wishes(**wishes)), lineage="l", serial=3)
    return PlanFile(
        octoform="1",
        host="bench",
        lineage="l",
        targets=None,
        replace=[],
        units=units(GRAPH, plan, prior, seen),
        plan=to_json(plan),
    )


def test_nothing_moved_everything_may_be_applied() -> None:
    document = saved({}, observed(files=dict.fromkeys(FILES)))
    assert moved(document, GRAPH, {}, observed(files=dict.fromkeys(FILES))) == []
    assert applicable(document, GRAPH, []) == set(GRAPH.names())


def test_hardware_that_moved_refuses_probe_and_all_that_is_built_on_it() -> None:
    document = saved({}, observed())
    stale = moved(document, GRAPH, {}, observed(fingerprint="sha256:other"))
    assert [(item.unit, item.part, item.before, item.after) for item in stale] == [
        ("probe", "hardware", FINGERPRINT, "sha256:other")
    ]
    assert applicable(document, GRAPH, stale) == set()
    assert "sha256:other" in (describe(stale[0]).detail or "")


def test_only_the_unit_that_moved_and_its_dependants_are_refused() -> None:
    prior = settled()
    document = saved(prior, observed(), replace=frozenset({"probe", "deploy"}))
    stale = moved(document, GRAPH, prior, observed(files={**FILES, "deploy": "sha256:edited"}))
    assert [(item.unit, item.part) for item in stale] == [("deploy", "artifact")]
    assert applicable(document, GRAPH, stale) == {"probe", "identify", "interface", "serve"}


def test_a_plan_that_was_applied_already_is_stale_by_its_state() -> None:
    document = saved({}, observed(files=dict.fromkeys(FILES)))
    stale = moved(document, GRAPH, settled(), observed())
    assert {item.part for item in stale if item.unit == "probe"} == {"state", "artifact"}


def test_an_unrelated_node_of_the_state_moves_nothing() -> None:
    prior = settled()
    document = saved(prior, observed(), replace=frozenset({"deploy"}))
    other = Prior("accepted", {**prior["probe"].key_parts, "note": "x"}, OUTPUTS["probe"], FILES["probe"])
    assert moved(document, GRAPH, settled(probe=other), observed()) == []


def test_a_file_that_is_no_plan_is_refused_by_code() -> None:
    good = saved({}, observed()).model_dump_json().encode()
    assert read(good, "p")[0] is not None
    for bad in (b"", b"{}", b"[1]", good[:-2], good.replace(b'"format":1', b'"format":2', 1)):
        document, found = read(bad, "p")
        assert document is None
        assert [item.code for item in found] == ["PLAN-NOT-A-PLAN"]


def test_json_there_and_back() -> None:
    plan = Plan(
        "bench",
        "apply",
        diff(GRAPH, settled(), observed(endpoint=("down",), fingerprint="sha256:other"), Wishes()),
        changes=(Change("hardware", "usb:v1d6b", Action.CREATE),),
        questions=(OpenQuestion("usb-1", "serial adapter", "Say what is attached.", 3),),
        devices=(NamedDevice("usb-2", "Heron lamp", 2, "the lamp", "lamp"),),
        profiles=(ProfileUse("lamp", "usb-2", Action.CREATE),),
        near=(NearProfile("pump", "usb-1", "Heron pump"),),
        tier1=True,
        dirty=("octopus.yaml",),
        targets=("probe",),
    )
    assert from_json(to_json(plan)) == plan


def test_a_plan_of_an_earlier_octoform_is_read() -> None:
    document = to_json(Plan("bench", "apply", (), questions=(OpenQuestion("usb-1", "adapter", "What is it?"),)))
    for name in ("devices", "profiles", "near", "tier1"):
        del document[name]
    del document["questions"][0]["tier"]
    assert from_json(document).questions[0].tier == 2
