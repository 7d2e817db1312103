"""Servers of devices with a profile: what contradicts its protocol definition is refused, what says it is not."""

from functools import cache
from pathlib import Path
from typing import Any

import pytest
from cases import for_each
from profile_servers import LAMP, OWN, RIGHT, WRONG

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.serve.stage import render
from octoform.contracts.model import Artifacts, ProfileFacts
from octoform.contracts.rules.serve.profile_rules import contradicted
from octoform.profiles import commands, definition, for_task, load, load_text

ROOT = Path(__file__).parents[3]
(ARM, RAIL), _ = load([ROOT / "profiles" / "so-arm101.md", ROOT / "profiles" / "camera-rail.md"])
LINE = load_text(LAMP, "bench-lamp.md")[0]
assert LINE is not None
DEVICES = {"arm": (ARM, "usb-1a86-55d3"), "rail": (RAIL, "usb-2341-804f"), "lamp": (LINE, "usb-16c0-05df")}


@cache
def served(name: str) -> tuple[str, Artifacts]:
    """The embedded agent's server of a device with a profile, and what it is held to."""
    profile, device = DEVICES[name]
    board = {"id": device, "name": name, "interface": "usb", "raw_descriptor": f"product: {name}", "classes": ["tty"]}
    probe: dict[str, Any] = {"devices": [board], "scans": []}
    task = for_task(profile, frozenset({device}))
    interface = declare(identify(probe, IdDatabases(Path("/nonexistent")), [task]), 30, [task])
    facts = ProfileFacts(
        profile.name, frozenset({device}), profile.limits, commands(profile), profile.product, definition(profile)
    )
    return render(interface, [task]), Artifacts(probe=probe, interface=interface, profiles={profile.name: facts})


def judged(case: tuple[str, str, str]) -> list[str]:
    name, old, new = case
    server, known = served(name)
    assert old in server, f"the server has no {old!r}"
    return [item.summary for item in contradicted(server.replace(old, new), known)]


@pytest.mark.parametrize("name", DEVICES)
def test_the_embedded_agents_server_says_what_the_profile_has(name: str) -> None:
    server, known = served(name)
    assert contradicted(server, known) == []


@for_each("case", WRONG)
def test_what_contradicts_the_profile_is_refused(case: str) -> None:
    *edit, words = WRONG[case]
    found = judged((edit[0], edit[1], edit[2]))
    assert len(found) == 1 and words in found[0], found


@for_each("case", RIGHT)
def test_what_says_it_in_other_words_is_accepted(case: str) -> None:
    assert judged(RIGHT[case]) == []


def test_without_a_protocol_definition_nothing_is_judged() -> None:
    server, known = served("rail")
    assert contradicted(server.replace("MOVE_X", "JOG"), Artifacts(interface=known.interface)) == []


@for_each("name", OWN)
def test_a_server_in_words_of_its_own_is_held_to_the_same(name: str) -> None:
    server, edits = OWN[name]
    _, known = served(name)
    assert contradicted(server, known) == []
    for (old, new), words in edits.items():
        assert old in server
        found = [item.summary for item in contradicted(server.replace(old, new), known)]
        assert any(words in item for item in found), (new, found)
