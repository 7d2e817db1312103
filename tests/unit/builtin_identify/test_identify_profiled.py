"""Profiles in the embedded agent: a product is named where its rule holds, and nowhere else."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from unit.builtin_identify.probes import NO_DATABASES, device, probe, usb

from octoform.builtin.identify import identify
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.profiles import devices_of, for_task, load

ROOT = Path(__file__).parents[3]
PROFILES, _ = load(sorted((ROOT / "profiles").glob("*.md")))
ARM, RAIL = "so-arm101", "camera-rail"


def agent(artifact: Mapping[str, Any], answers: Mapping[str, str] | None = None) -> dict[str, dict[str, Any]]:
    """The agent's annotation of each device, as octoform gives it the profiles; the contract has nothing against it."""
    held = [(profile, devices_of(profile, artifact, answers or {})) for profile in PROFILES]
    task = [for_task(profile, ids) for profile, ids in held if ids]
    found = identify(dict(artifact), NO_DATABASES, task)
    facts = {profile.name: ProfileFacts(profile.name, ids, profile.limits) for profile, ids in held}
    problems = check("identify", found, Artifacts(probe=dict(artifact), profiles=facts), ROOT / "protocol" / "schemas")
    assert problems == []
    return {item["id"]: item for item in (*found["devices"], *found["left_out"])}


def board(vid: str, pid: str, product: str) -> dict[str, Any]:
    line = "interface[0]: class 02/02/01 driver=cdc_acm"
    return usb(f"product: {product}", line, vid=vid, pid=pid, nodes=[("tty", "ttyACM0")])


@pytest.mark.parametrize("pid", ["7523", "55d3"])
@pytest.mark.parametrize("by_answer", [False, True])
def test_truth_table_of_the_arm(pid: str, by_answer: bool) -> None:
    """Chip and word: the arm. Chip only: unknown, with one question. Word only, neither: whatever it is, no arm."""
    word = "USB Serial" if by_answer else "Feetech URT"
    sentence = "the SO-ARM101 of the bench"
    for chip, named in ((True, True), (True, False), (False, True), (False, False)):
        entry = board("1a86" if chip else "1d9c", pid, word if named else "USB Serial")
        answers = {entry["id"]: sentence} if by_answer and named else {}
        found = agent(probe(entry), answers)[entry["id"]]
        if chip and named:
            assert (found["profile"], found["method"]) == (ARM, "profile")
            assert (found["identified_as"], found["class"]) == ("SO-ARM101 robot arm", "register_bus")
            assert all(item["name"].startswith("arm_") for item in found["capabilities"])
            assert {item["via"].partition(",")[0] for item in found["capabilities"]} == {"feetech-servo-sdk"}
        else:
            assert "profile" not in found and found.get("method") != "profile"
        if not named:
            assert found["category"] == "unknown" and found["capabilities"] == []
            assert found["missing"].count("?") == 1


def test_a_grammar_gives_all_the_capabilities_there_are() -> None:
    entry = board("2341", "804f", "Camera Rail 2") | {"classes": ["tty", "leds"]}
    entry["raw_descriptor"] += "\nclass[0].x: y\nleds[0].name: rail:green:status\nleds[0].max_brightness: 1"
    found = agent(probe(entry))[entry["id"]]
    assert (found["category"], found["class"], found["confidence"]) == ("bidirectional", "line_protocol", 0.9)
    assert {item["name"]: item["effect"] for item in found["capabilities"]} == {
        **dict.fromkeys(("rail_move_x", "rail_move_y", "rail_home", "rail_stop"), "actuate"),
        "rail_position": "read",
    }
    assert [item["name"] for item in found["capabilities"] if item.get("stops")] == ["rail_stop"]
    steps = found["capabilities"][0]["parameters"]["steps"]
    assert (steps["type"], steps["minimum"], steps["maximum"], steps["unit"]) == ("integer", -2000, 2000, "steps")
    assert found["evidence"][0] == {
        "quote": "product: Camera Rail 2",
        "says": "the match rule of the profile camera-rail matches this device",
    }


def test_a_profile_cannot_manufacture_hardware() -> None:
    """The owner speaks of a rail and an arm; neither is attached, and nothing in what is found comes from them."""
    answers = {"usb-1a86-7523": "the SO-ARM101", "usb-2341-804f": "the camera rail", "usb-1d9c-0001": "the camera rail"}
    neighbour = usb("product: Camera Rail", vid="2341", pid="804f", context=True)
    others = usb("product: Heron Stepper HW-12"), device("platform-leds", "platform", "name: camera rail")
    for artifact in (probe(), probe(*others), probe(neighbour)):
        for item in agent(artifact, answers).values():
            assert "profile" not in item
            assert not any(capability["name"].startswith("rail_") for capability in item.get("capabilities", ()))


def test_an_agent_that_claims_a_profile_for_another_device_is_refused() -> None:
    rail, other = board("2341", "804f", "Camera Rail"), board("1d9c", "0002", "Heron Stepper HW-12")
    artifact = probe(rail, other)
    facts = {item.name: ProfileFacts(item.name, devices_of(item, artifact), item.limits) for item in PROFILES}
    found = identify(artifact, NO_DATABASES, [for_task(item, facts[item.name].holds) for item in PROFILES])
    stolen = next(item for item in found["devices"] if item["id"] == other["id"])
    stolen |= {"method": "profile", "profile": RAIL}
    problems = check("identify", found, Artifacts(probe=artifact, profiles=facts), ROOT / "protocol" / "schemas")
    assert [item.code for item in problems] == ["IDENTIFY-PROFILE-EVIDENCE"]
