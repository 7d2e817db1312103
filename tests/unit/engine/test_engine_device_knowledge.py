"""Tiers, profiles and questions as the plan shows them: a device is asked about once, and each answer counts."""

from pathlib import Path
from typing import Any

import pytest

from octoform.diagnostics import Severity
from octoform.engine.plan import device_knowledge
from octoform.engine.plan.configuration import compile_project
from octoform.plan.diff import Prior
from octoform.plan.model import Action, OpenQuestion, ProfileUse
from octoform.profiles import Profile, load_text

BOARD, LAMP = "usb-0a0a-0001", "usb-0a0a-0002"
PROFILE = "---\nname: pump\nabout: a pump\nevidence: {text: [Heron pump]}\n---\nIt pumps.\n"
ARTIFACTS: dict[str, Any] = {
    "probe": {
        "devices": [
            {"id": BOARD, "name": "USB Serial", "interface": "usb", "raw_descriptor": "product: USB Serial"},
            {"id": LAMP, "name": "Heron lamp", "interface": "usb", "raw_descriptor": "product: Heron lamp"},
        ]
    },
    "identify": {
        "devices": [
            {
                "id": BOARD,
                "identified_as": "serial adapter",
                "category": "unknown",
                "method": "none",
                "missing": "What?",
            },
            {"id": LAMP, "identified_as": "Heron lamp", "category": "actuator", "method": "descriptor_strings"},
        ]
    },
}


@pytest.fixture
def pump() -> Profile:
    profile, found = load_text(PROFILE, "octopus.yaml")
    assert profile is not None, found
    return profile


def test_a_question_is_open_until_somebody_answers() -> None:
    assert device_knowledge.questions(ARTIFACTS, {}) == (OpenQuestion(BOARD, "serial adapter", "What?", 2),)
    assert device_knowledge.questions(ARTIFACTS, {BOARD: "a pump"}) == ()
    assert device_knowledge.questions({}, {}) == ()


def test_the_tier_is_of_what_was_said_when_identify_was_accepted(pump: Profile) -> None:
    assert [(item.device, item.tier) for item in device_knowledge.devices(ARTIFACTS, (pump,), {})] == [(LAMP, 1)]
    parts = {f"answer.{LAMP}": "above the bench"}
    (device,) = device_knowledge.devices(ARTIFACTS, (pump,), {"identify": Prior("accepted", parts, "d", "f")})
    assert (device.tier, device.answer) == (2, "above the bench")


def test_a_plan_says_for_whom_a_profile_would_hold(pump: Profile) -> None:
    answers = {BOARD: "the Heron pump on the left"}
    accepted = {"profile.pump": pump.digest}
    fields = {**accepted, f"answer.{BOARD}": "the Heron pump"}

    def uses(parts: dict[str, str], now: dict[str, str]) -> list[Action]:
        found = device_knowledge.profile_uses(ARTIFACTS, (pump,), now, {"identify": Prior("accepted", parts, "d", "f")})
        assert {(item.profile, item.device) for item in found} <= {("pump", BOARD)}
        return [item.action for item in found]

    assert uses(accepted, {}) == []
    assert uses(accepted, answers) == [Action.CREATE]
    assert uses(fields, answers) == [Action.NOOP]
    assert uses(fields, {}) == [Action.DESTROY]
    assert uses({f"answer.{BOARD}": "the Heron pump"}, answers) == [Action.CREATE], "the profile itself is new"
    assert device_knowledge.profile_uses(ARTIFACTS, (pump,), answers, {}) == (ProfileUse("pump", BOARD, Action.CREATE),)


def test_an_answer_without_its_device_names_the_one_that_it_is_a_slip_of() -> None:
    (found,) = device_knowledge.stray(ARTIFACTS, {"usb-0a0-0001": "a pump", LAMP: "it shines"})
    assert found.code == "PLAN-ANSWER-WITHOUT-DEVICE"
    assert "did you mean usb-0a0a-000" in (found.hint or "")
    (found,) = device_knowledge.stray(ARTIFACTS, {"usb-0a0a-0003": "a pump"})
    assert "did you mean" not in (found.hint or ""), "another number is another device"
    assert device_knowledge.stray({}, {"usb-0a0a-0003": "a pump"}) == []


ARM: dict[str, Any] = {
    "id": BOARD,
    "name": "USB Single Serial",
    "interface": "usb",
    "vid": "1a86",
    "pid": "55d3",
    "classes": ["tty"],
    "raw_descriptor": "product: LeRobot arm bus",
}


def offers(folder: Path, manifest: str = "", **device: Any) -> list[tuple[str, str | None]]:
    (folder / "octopus.yaml").write_text(f"version: 1\nhost: bench\n{manifest}")
    compiled, found = compile_project(folder, {})
    assert compiled is not None, found
    result = device_knowledge.offers({"probe": {"devices": [{**ARM, **device}]}}, compiled)
    return [(item.code, item.hint) for item in result]


def test_a_shipped_profile_that_matches_is_offered_with_its_line(tmp_path: Path) -> None:
    assert offers(tmp_path) == [("PROFILE-OFFERED", "write `profiles: [so-arm101]` in octopus.yaml to use it")]
    other = "profiles: [camera-rail]\n"
    assert offers(tmp_path, other) == [("PROFILE-OFFERED", "add `so-arm101` to `profiles` in octopus.yaml to use it")]


def test_what_is_named_or_does_not_match_is_not_offered(tmp_path: Path) -> None:
    assert offers(tmp_path, "profiles: [so-arm101]\n") == []
    assert offers(tmp_path, raw_descriptor="product: USB Serial") == []


def test_the_owners_answer_makes_a_shipped_profile_match(tmp_path: Path) -> None:
    silent = {"raw_descriptor": "product: USB Serial"}
    assert offers(tmp_path, f"answers: {{{BOARD}: the SO-ARM101 on the bench}}\n", **silent) != []


def uncovered(folder: Path, tools: list[str], left_out: list[dict[str, str]], manifest: str) -> list[Any]:
    (folder / "octopus.yaml").write_text(f"version: 1\nhost: bench\n{manifest}")
    compiled, found = compile_project(folder, {})
    assert compiled is not None, found
    interface = {"tools": [{"capability": name, "devices": [BOARD]} for name in tools], "left_out": left_out}
    return device_knowledge.uncovered({"probe": {"devices": [ARM]}, "interface": interface}, compiled)


def test_commands_of_a_chosen_profile_without_a_tool_are_told_with_the_reason(tmp_path: Path) -> None:
    chosen = "profiles: [so-arm101]\n"
    left = [{"id": BOARD, "reason": "tool_budget", "detail": "the camera is\x1b missed more"}]
    (found,) = uncovered(tmp_path, ["arm_status", "arm_stop"], left, chosen)
    assert found.code == "PROFILE-COMMANDS-MISSING"
    assert "arm_move_joint" in found.summary and "arm_status" not in found.summary
    assert found.detail == f"{BOARD}: tool_budget - the camera is\\x1b missed more"
    (bare,) = uncovered(tmp_path, ["arm_stop"], [], chosen)
    assert bare.detail == "INTERFACE gives no reason"
    every = [*found.summary.partition(": ")[2].split(", "), "arm_status", "arm_stop"]
    assert uncovered(tmp_path, every, [], chosen) == []
    assert uncovered(tmp_path, [], [], "") == []


def unmatched(folder: Path, manifest: str, devices: list[dict[str, Any]]) -> list[Any]:
    (folder / "octopus.yaml").write_text(f"version: 1\nhost: bench\n{manifest}")
    compiled, found = compile_project(folder, {})
    assert compiled is not None, found
    assert device_knowledge.unmatched({}, compiled) == [], "nothing is known before PROBE"
    return device_knowledge.unmatched({"probe": {"devices": devices}}, compiled)


def test_a_chosen_profile_that_matches_nothing_is_told_with_its_rule_and_the_nearest_device(tmp_path: Path) -> None:
    chosen, silent = "profiles: [so-arm101]\n", {**ARM, "raw_descriptor": "product: USB Serial"}
    lamp = {"id": LAMP, "name": "Heron\x1b lamp", "interface": "usb", "classes": ["tty"]}
    assert unmatched(tmp_path, chosen, [ARM]) == []
    assert unmatched(tmp_path, chosen, [lamp, ARM]) == []
    (found,) = unmatched(tmp_path, chosen, [lamp, silent])
    assert (found.code, found.severity) == ("PROFILE-UNMATCHED", Severity.WARNING)
    assert found.summary == "the profile so-arm101 matches no device of this host and has no effect"
    rule, nearest = found.detail.splitlines()
    assert rule.startswith("its match rule asks for the number 1a86:7523 or 1a86:55d3 and text with ")
    assert nearest.startswith(
        f"nearest is {BOARD} (USB Single Serial), which has the number 1a86:7523 or 1a86:55d3, and"
    )
    assert f'octoform answer {BOARD} "... ' in found.hint and "octoform profile check so-arm101" in found.hint
    assert unmatched(tmp_path, f"{chosen}answers: {{{BOARD}: the SO-ARM101}}\n", [silent]) == []
    (neighbour,) = unmatched(tmp_path, chosen, [{**ARM, "context": True}])
    assert "no device of this host meets any part of it" in neighbour.detail
    (other,) = unmatched(tmp_path, chosen, [lamp])
    assert "no device of this host meets any part of it" in other.detail and "answer" not in other.hint


def test_a_rule_of_every_kind_is_described_and_a_device_that_has_a_word_of_it_is_nearer_than_one_of_its_class(
    tmp_path: Path,
) -> None:
    rule = "{all: [{any: [{text: [Heron, Egret]}, {not: {driver: ftdi}}]}, {class: tty}, {interface: pci}]}"
    lines = ("---", "name: pump", "about: a pump", f"evidence: {rule}", "---", "It pumps.")
    inline = "profiles:\n  - |\n" + "".join(f"    {line}\n" for line in lines)
    devices = [{**ARM, "classes": ["tty"]}, {"id": LAMP, "name": "Heron\x1b lamp", "interface": "usb"}]
    (found,) = unmatched(tmp_path, inline, devices)
    asked = "(text with Heron or Egret or not (the driver ftdi)) and the class tty and the interface pci"
    assert found.detail.splitlines() == [
        f"its match rule asks for {asked}",
        f"nearest is {LAMP} (Heron\\x1b lamp), which has text with Heron or Egret, and lacks "
        "the class tty; the interface pci",
    ]
