"""A profile is no hardware: without the evidence for its device there is no tool of it, whatever else is there."""

from pathlib import Path
from typing import Any

import pytest
from virtual_rig import ANSWERS, ARM, PROFILES, RAIL, described

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.profiles import devices_of, for_task
from octoform.profiles.profile_parser import load
from octoform.simulation.rig import Rig

SMALL = {"width": 32, "height": 24, "frames": 1}


def tools(folder: Path, answers: dict[str, str], description: dict[str, Any]) -> dict[str, set[str]]:
    """Names of tools by device, as the embedded agent declares them for a rig."""
    rig = Rig(description, folder)
    rig.start()
    try:
        probe = probe_root(folder)
    finally:
        rig.stop()
    profiles, found = load(PROFILES)
    assert not found
    known = [for_task(one, devices_of(one, probe, answers)) for one in profiles]
    interface = declare(identify(probe, IdDatabases(folder), known, answers), 30, known)
    devices = {device for tool in interface["tools"] for device in tool["devices"]}
    return {device: {tool["name"] for tool in interface["tools"] if device in tool["devices"]} for device in devices}


def other_chip(name: str, product: str, other: str) -> dict[str, Any]:
    """The rig with another chip in a device whose strings say the same."""
    rig = described(camera=SMALL)
    text = rig["devices"][name]["descriptors"]
    assert product in text
    rig["devices"][name]["descriptors"] = text.replace(product, other).replace(product.upper(), other.upper())
    return rig


def test_with_evidence_both_have_their_tools(tmp_path: Path) -> None:
    found = tools(tmp_path, ANSWERS, described(camera=SMALL))
    assert "arm_move_joint" in found[ARM] and found[RAIL] >= {"rail_move_x", "rail_move_y", "rail_home"}


@pytest.mark.parametrize(
    ("description", "answers"),
    [
        (described(camera=SMALL, arm={"anonymous": True}), {}),
        (other_chip("arm", "55d3", "55d4"), {}),
        (described(camera=SMALL, arm={"unplugged": True}), {}),
        (described(camera=SMALL, arm={"anonymous": True}), {ARM: "the grey box on the left"}),
    ],
    ids=["without corroboration", "the wrong chip", "no device", "an answer that says something else"],
)
def test_without_it_no_tool_of_the_arm_appears(
    tmp_path: Path, description: dict[str, Any], answers: dict[str, str]
) -> None:
    found = tools(tmp_path, answers, description)
    assert not any(name.startswith(("arm_", "rail_")) for names in found.values() for name in names)
    assert any("capture_image" in names for names in found.values())


def test_a_persons_word_is_evidence_too(tmp_path: Path) -> None:
    rig = described(camera=SMALL, arm={"anonymous": True})
    assert "arm_move_joint" in tools(tmp_path, {ARM: "the SO-ARM101 on the left of the bench"}, rig)[ARM]


def test_a_word_for_another_device_is_none(tmp_path: Path) -> None:
    found = tools(tmp_path, {ARM: "the camera rail of the bench"}, described(camera=SMALL, arm={"anonymous": True}))
    assert not any(name.startswith("rail_") for names in found.values() for name in names)
