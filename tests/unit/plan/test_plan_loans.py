"""Outputs of other hosts: what stands for a run of an agent, for certain or perhaps, and what never does."""

from dataclasses import replace

from unit.plan.settled_graph import GRAPH, OUTPUTS, observed, settled

from octoform.graph.model import key_parts
from octoform.plan.diff import Offer, Offers, Prior, Wishes, diff, with_reuse
from octoform.plan.model import PlannedAction, Reuse

FRESH = "sha256:of-another"


def parts_of(name: str, **inputs: str) -> dict[str, str]:
    """The parts of this stage's key over these outputs of the stages before, and the settled ones."""
    return key_parts(GRAPH.node(name), {**OUTPUTS, **inputs}, None)


def lent(offers: Offers, prior: dict[str, Prior] | None = None, **wishes: frozenset[str]) -> dict[str, PlannedAction]:
    """The plan with these offers, where the spec of IDENTIFY is another one than it was."""
    if prior is None:
        known = settled()["identify"]
        prior = settled(identify=replace(known, key_parts={**known.key_parts, "spec": "sha256:older"}))
    actions = diff(GRAPH, prior, observed(), Wishes(**wishes))
    return {action.node: action for action in with_reuse(GRAPH, actions, prior, offers)}


def test_an_output_of_the_same_key_is_taken_and_no_agent_called() -> None:
    planned = lent({"identify": (Offer("desk", parts_of("identify"), FRESH),)})
    assert planned["identify"].loan == Reuse("desk", FRESH, certain=True)
    assert not planned["identify"].calls_agent and not planned["identify"].calls_model


def test_a_model_is_called_only_where_no_output_is_certain() -> None:
    known = settled()["identify"]
    prior = settled(identify=replace(known, key_parts={**known.key_parts, "spec": "sha256:older"}))
    asks = tuple(replace(action, calls_model=True) for action in diff(GRAPH, prior, observed(), Wishes()))
    offers = {
        "identify": (Offer("desk", parts_of("identify"), FRESH),),
        "interface": (Offer("desk", parts_of("interface", identify=FRESH), "sha256:tools"),),
    }
    planned = {action.node: action for action in with_reuse(GRAPH, asks, prior, offers)}
    assert [planned[name].calls_model for name in ("identify", "interface")] == [False, True]


def test_an_output_of_another_key_is_not() -> None:
    offer = Offer("desk", {**parts_of("identify"), "spec": "sha256:of-the-desk"}, FRESH)
    planned = lent({"identify": (offer,)})
    assert planned["identify"].loan is None and planned["identify"].calls_agent


def test_the_first_that_fits_is_taken() -> None:
    wrong = Offer("desk", parts_of("identify", probe="sha256:other"), "sha256:a")
    right, later = (Offer(host, parts_of("identify"), FRESH) for host in ("shelf", "van"))
    assert lent({"identify": (wrong, right, later)})["identify"].loan == Reuse("shelf", FRESH, certain=True)


def test_what_a_person_wants_anew_is_never_lent() -> None:
    offers = {"identify": (Offer("desk", parts_of("identify"), FRESH),)}
    planned = lent(offers, settled(), replace=frozenset({"identify"}))
    assert planned["identify"].loan is None and planned["identify"].calls_agent


def test_a_stage_behind_one_that_is_lent_has_the_lent_output_as_its_input() -> None:
    wrong = Offer("shelf", parts_of("interface"), "sha256:others")
    behind = Offer("desk", parts_of("interface", identify=FRESH), "sha256:tools")
    planned = lent({"identify": (Offer("desk", parts_of("identify"), FRESH),), "interface": (wrong, behind)})
    assert planned["interface"].loan == Reuse("desk", "sha256:tools", certain=False)
    assert planned["interface"].calls_agent, "it is carried out only where the output is another one"


def test_while_an_input_is_unknown_the_rest_of_the_key_decides_whether_it_may_fit() -> None:
    fits = Offer("desk", parts_of("interface", identify="sha256:whatever"), "sha256:tools")
    wrong = Offer("shelf", {**parts_of("interface"), "model": "another"}, "sha256:others")
    planned = lent({"interface": (wrong, fits)})
    assert planned["identify"].loan is None
    assert planned["interface"].loan == Reuse("desk", "sha256:tools", certain=False)
