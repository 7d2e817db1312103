"""The scorer's own judgement: what counts as named, as rightly unknown, and as a misidentification."""

from dataclasses import replace
from typing import Any

import pytest
from recordings import score
from recordings.truth import Item, Units

ITEM = Item(
    recording="bench",
    match='usb 1d9c:0001 at 1-2 "Kestrel HD-40"',
    product="Kestrel HD-40 webcam",
    category="sensor",
    also_ok=("bidirectional",),
    kind="camera",
    capabilities=("take_photo",),
    must_not_be=("scanner", "an Apple keyboard", "a webcam by brand"),
    identified_by="strings",
    by_hand=True,
)
UNIT = {
    "id": "usb-1d9c-0001",
    "interface": "usb",
    "vid": "1d9c",
    "pid": "0001",
    "classes": ["hwmon", "video4linux"],
    "raw_descriptor": "hwmon[0].name: ext9",
    "instance": {
        "port": "1-2",
        "sysfs": "/sys/devices/pci/usb1/1-2",
        "paths": ["/sys/devices/pci/usb1/1-2/1-2:1.0/video4linux/video0"],
        "nodes": [{"class": "video4linux", "name": "video0"}, {"class": "hwmon", "name": "hwmon0"}],
    },
}


def told(name: str, category: str = "sensor", confidence: float = 0.9, **more: Any) -> dict[str, Any]:
    return {"identified_as": name, "category": category, "confidence": confidence, "capabilities": [], **more}


@pytest.mark.parametrize(
    ("answer", "item", "result"),
    [
        (told("Kestrel HD-40"), ITEM, score.NAMED),
        (told("Kestrel HD-40", "bidirectional"), ITEM, score.NAMED),
        (told("Kestrel HD-40", "actuator"), ITEM, score.MISSED),
        (told("USB camera", confidence=0.3), ITEM, score.MISSED),
        (told("USB camera", confidence=0.3), replace(ITEM, identified_by="class"), score.NAMED),
        (told("Kestrel scanner"), ITEM, score.MISIDENTIFIED),
        (told("Apple keyboard"), ITEM, score.MISIDENTIFIED),
        (told("Heron 9"), ITEM, score.MISIDENTIFIED),
        (told("Heron 9", confidence=0.4), ITEM, score.MISSED),
        (told("Kestrel HD-40"), replace(ITEM, identified_by="context"), score.MISIDENTIFIED),
        (told("pen tablet", confidence=0.4), replace(ITEM, identified_by="context"), score.UNKNOWN_RIGHT),
        (told("USB adapter", "unknown", 0.0), replace(ITEM, also_ok=("unknown",)), score.UNKNOWN_RIGHT),
        (told("USB adapter", "unknown", 0.0), ITEM, score.MISSED),
        (None, ITEM, score.LEFT_OUT),
    ],
)
def test_an_answer_is_judged(answer: dict[str, Any] | None, item: Item, result: str) -> None:
    assert score.mark(item, UNIT, answer, []).result == result


def test_a_forbidden_word_in_a_capability_counts() -> None:
    answer = told("Kestrel HD-40", capabilities=[{"name": "read_scanner"}])
    assert score.mark(ITEM, UNIT, answer, []).result == score.MISIDENTIFIED


def test_a_tool_that_means_the_same_makes_it_usable() -> None:
    tools = [{"capability": "capture_image", "devices": [UNIT["id"]]}]
    assert score.mark(ITEM, UNIT, told("Kestrel HD-40"), tools).usable is True
    assert score.mark(ITEM, UNIT, told("Kestrel HD-40"), []).usable is False
    assert score.mark(ITEM, {**UNIT, "classes": []}, told("Kestrel HD-40"), []).usable is None
    assert score.mark(replace(ITEM, category="infrastructure"), UNIT, told("Kestrel HD-40"), tools).usable is None


@pytest.mark.parametrize(
    "match",
    [
        'usb 1d9c:0001 at 1-2 "Kestrel"',
        "usb 1d9c:0001",
        "sysfs /devices/pci/usb1/1-2/1-2:1.0/video4linux/video0 (/dev/video0)",
        '/dev/video0 "Kestrel" on usb',
        "hwmon ext9-virtual-0",
        "serial port usb-Kestrel-if00 (usb 1d9c:0001)",
    ],
)
def test_a_match_finds_its_unit(match: str) -> None:
    assert Units({"devices": [UNIT]}).find(replace(ITEM, match=match)) == UNIT


def test_what_probe_does_not_show_is_not_seen() -> None:
    assert Units({"devices": [UNIT]}).find(replace(ITEM, match="usb 1d9c:0002")) is None
    assert score.mark(ITEM, None, None, []).result == score.NOT_SEEN
