"""The shipped specs as texts: their size, what they may not name, and what they must carry."""

import json
import re
from pathlib import Path

import pytest

from octoform.protocol import DUTIES, STAGES, Spec
from octoform.protocol.loading import load

SPECS: dict[str, Spec] = load(None)[0]
DEVICE_SPECIFIC = (
    *("lsusb", "system_profiler", "ioreg", "/dev/cu", "CoreAudio", "v4l2", "video4linux", "AVFoundation", "DirectShow"),
    *("wmic", "lspci", "dmesg", "udevadm", "Get-PnpDevice", "/dev/tty", "/dev/video", "COM3", "ALSA", "arecord"),
)
JUDGEMENT = {
    "probe": [
        "time limit",
        "`not_found`",
        "`timeout`",
        "every",
        "Install nothing",
        "context: true",
        "serial line",
        "data",
    ],
    "identify": [
        "Evidence only",
        "letter by letter",
        "not the chip",
        "`unknown`",
        "0.0",
        "`missing`",
        "`via`",
        "left_out",
    ],
    "interface": ["One capability, one tool", "unit", "`smoke", "tool_budget", "left_out", "`limits`", "no free-text"],
    "serve": ["# /// script", "fastmcp>=4.1,<4.2", "runtime.logged", "runtime.bus", "runtime.device", "500 lines"],
    "deploy": ["exact", "conflicts", "deps_failed", "Install nothing outside", "`provided_by`"],
    "watch": [
        "Readings decide",
        "Absence is unknown",
        "Text is data",
        "`available` is false",
        "change nothing",
        "refute",
    ],
    "heal": [
        "nothing else",
        "never deleted",
        "A limit is never weakened",
        "`not_mine`",
        "must exist there",
        "are data",
    ],
}


def test_those_of_the_stages_have_300_to_550_lines_and_a_duty_at_most_120() -> None:
    assert tuple(SPECS) == (*STAGES, *DUTIES)
    lines = {name: len(spec.text.splitlines()) for name, spec in SPECS.items()}
    assert 300 <= sum(lines[stage] for stage in STAGES) <= 550
    assert max(lines[duty] for duty in DUTIES) <= 120


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_no_tool_or_interface_of_one_system_is_named(stage: str) -> None:
    text = SPECS[stage].text.casefold()
    assert [word for word in DEVICE_SPECIFIC if word.casefold() in text] == []


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_the_judgement_of_the_stage_is_there(stage: str) -> None:
    text = " ".join(SPECS[stage].text.split()).casefold()
    assert [phrase for phrase in JUDGEMENT[stage] if phrase.casefold() not in text] == []


@pytest.mark.parametrize("stage", [*STAGES, *DUTIES])
def test_lines_are_short_and_unrendered_markup_is_absent(stage: str) -> None:
    text = SPECS[stage].text
    assert max(len(line) for line in text.splitlines()) <= 120
    assert "{{" not in text and "{%" not in text


@pytest.mark.parametrize("stage", ["probe", "identify", "interface", "deploy", *DUTIES])
def test_each_required_member_of_the_schema_is_explained(stage: str) -> None:
    """An agent with the spec alone would still know what each member is for."""
    schema = SPECS[stage].schema
    assert schema is not None
    document = json.loads(Path(schema).read_text())
    required = set(document["required"]) - {"format", "platform", "stage"}
    for definition in document.get("$defs", {}).values():
        required |= set(definition.get("required", ()))
    text = SPECS[stage].body
    required -= {"quote", "reason", "id", "version", "module", "name", "description", "status", "parameter"}
    assert sorted(name for name in required if not re.search(rf"\b{name}\b", text)) == []
