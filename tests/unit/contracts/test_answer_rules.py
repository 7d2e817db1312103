"""What a person said of a device: it counts where it was said, it is not passed over, and it is asked once."""

from dataclasses import replace
from typing import Any

import pytest
from unit.contracts.contract_samples import SCHEMAS, artifacts, good

from octoform.contracts.contract_check import check
from octoform.contracts.model import ProfileFacts
from octoform.contracts.rules.identify.answer_rules import tier, wanted

LAMP = "usb-1234-0002"
BOARD = "usb-1234-0003"
SENTENCE = "the pump board:\n  channel 1 is the drain"


def codes(value: dict[str, Any], answers: dict[str, str]) -> list[str]:
    given = replace(artifacts(), answers=answers)
    return [item.code for item in check("identify", value, given, SCHEMAS)]


def with_device(name: str, **changes: Any) -> dict[str, Any]:
    value: dict[str, Any] = good("identify")
    device = next(item for item in value["devices"] if item["id"] == name)
    device.update(changes)
    return value


def named() -> dict[str, Any]:
    changes = {"identified_as": "pump board", "category": "actuator", "confidence": 0.9, "method": "user_answer"}
    return with_device(BOARD, **changes, evidence=[{"quote": "the pump board"}, {"quote": "USB Serial"}])


def test_a_device_is_named_by_its_answer_alone() -> None:
    assert codes(named(), {BOARD: SENTENCE}) == []
    of_nobody = named()
    next(item for item in of_nobody["devices"] if item["id"] == BOARD)["evidence"] = [{"quote": "USB Serial"}]
    assert codes(of_nobody, {}) == ["IDENTIFY-ANSWER-INVENTED"]
    assert codes(of_nobody, {LAMP: SENTENCE}) == ["IDENTIFY-ANSWER-INVENTED"]
    assert codes(of_nobody, {BOARD: SENTENCE}) == ["IDENTIFY-METHOD-FALSE"]


def test_an_answer_is_not_passed_over() -> None:
    assert codes(good("identify"), {}) == []
    assert codes(good("identify"), {BOARD: SENTENCE}) == ["IDENTIFY-ANSWER-IGNORED"]


def test_an_answer_does_not_stand_in_for_the_profile_that_holds() -> None:
    can = {"name": "switch_pump", "description": "switch it", "via": "pyserial", "effect": "actuate"}
    facts = {**artifacts().profiles, "pump": ProfileFacts("pump", frozenset({BOARD}))}
    for more, found in (({}, ["IDENTIFY-PROFILE-IGNORED"]), ({"profile": "pump"}, []), ({"capabilities": []}, [])):
        value = named()
        next(item for item in value["devices"] if item["id"] == BOARD).update({"capabilities": [can], **more})
        given = replace(artifacts(), answers={BOARD: SENTENCE}, profiles=facts)
        assert [item.code for item in check("identify", value, given, SCHEMAS)] == found


def test_a_device_may_be_left_out_for_its_answer() -> None:
    value = good("identify")
    value["devices"] = [item for item in value["devices"] if item["id"] != BOARD]
    value["left_out"].append({"id": BOARD, "reason": "no_function", "detail": "the owner says: nothing is wired"})
    assert codes(value, {BOARD: "nothing is wired to it"}) == []
    assert codes(value, {}) == ["IDENTIFY-LINE-LEFT-OUT"]


@pytest.mark.parametrize("quote", ["the pump board", "board:\n  channel", "the pump board: channel 1 is the drain"])
def test_evidence_may_quote_the_answer(quote: str) -> None:
    value = named()
    next(item for item in value["devices"] if item["id"] == BOARD)["evidence"].append({"quote": quote})
    assert codes(value, {BOARD: SENTENCE}) == []


def test_a_quote_of_anothers_answer_or_of_none_is_refused() -> None:
    value = with_device(LAMP, evidence=[{"quote": "the pump board"}])
    assert codes(value, {}) == ["IDENTIFY-QUOTE-NOT-VERBATIM"]
    value = named()
    next(item for item in value["devices"] if item["id"] == LAMP)["evidence"] = [{"quote": "the pump board"}]
    assert codes(value, {BOARD: SENTENCE}) == ["IDENTIFY-QUOTE-NOT-VERBATIM"]


@pytest.mark.parametrize(
    ("text", "good_text"),
    [
        ("What is it? And how fast?", False),
        ("What is it\uff1f And how fast\u061f", False),
        ("What is it wired to?", True),
    ],
)
def test_a_device_has_one_question(text: str, good_text: bool) -> None:
    assert codes(with_device(BOARD, missing=text), {}) == ([] if good_text else ["IDENTIFY-MANY-QUESTIONS"])


@pytest.mark.parametrize(
    ("annotation", "expected"),
    [
        ({"method": "descriptor_strings", "category": "sensor"}, 1),
        ({"method": "descriptor_strings", "category": "sensor", "id": "spoken"}, 2),
        ({"method": "user_answer", "category": "actuator"}, 2),
        ({"method": "profile", "category": "actuator", "profile": "arm"}, 2),
        ({"method": "profile", "category": "actuator", "profile": "rail"}, 3),
        ({"method": "none", "category": "unknown"}, 1),
    ],
)
def test_the_tier_is_what_had_to_be_said(annotation: dict[str, Any], expected: int) -> None:
    device = {"id": "silent", **annotation}
    assert tier(device, {"spoken"}, {"rail"}) == expected
    assert wanted(device) == (2 if annotation["category"] == "unknown" else None)
