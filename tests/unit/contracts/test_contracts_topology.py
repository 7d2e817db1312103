"""A camera and a device that is commanded on one hub are reported; the machine's own ports do not count."""

from typing import Any

import pytest

from octoform.contracts.model import Artifacts
from octoform.contracts.rules.topology_rules import RULES, shared_hub
from octoform.diagnostics import Severity

ROOT = "/sys/devices/pci0000:00/0000:00:14.0/usb1"
CAMERA, ARM, HUB = "usb-1f00-00c1", "usb-1f00-00a1", "usb-1f00-0009"


def artifacts(camera: str, arm: str, hub: str, **facts: Any) -> Artifacts:
    places = {CAMERA: camera, ARM: arm, HUB: hub}
    devices = [{"id": name, "raw_descriptor": "", "instance": {"sysfs": ROOT + at}} for name, at in places.items()]
    devices[1] |= facts or {"classes": ["tty"]}
    return Artifacts(probe={"devices": devices})


def identified(category: str = "unknown", kind: str = "serial") -> dict[str, Any]:
    return {
        "devices": [
            {"id": HUB, "category": "infrastructure", "class": "hub", "capabilities": []},
            {"id": ARM, "category": category, "class": kind, "capabilities": []},
            {"id": CAMERA, "category": "sensor", "capabilities": [{"name": "capture_image"}]},
        ]
    }


def test_both_devices_and_the_hub_are_named() -> None:
    (found,) = shared_hub(identified(), artifacts("/1-2/1-2.1", "/1-2/1-2.4", "/1-2"))
    assert (found.code, found.severity, found.pointer) == ("IDENTIFY-SHARED-HUB", Severity.WARNING, "/devices/2")
    assert all(f"'{name}'" in found.summary for name in (CAMERA, ARM, HUB))
    assert [rule.code for rule in RULES] == [found.code]


def test_a_hub_behind_a_hub_is_the_one_that_is_named() -> None:
    (found,) = shared_hub(identified(), artifacts("/1-2/1-2.3/1-2.3.1", "/1-2/1-2.3/1-2.3.2", "/1-2/1-2.3"))
    assert f"'{HUB}'" in found.summary
    (found,) = shared_hub(identified(), artifacts("/1-2/1-2.3/1-2.3.1", "/1-2/1-2.4", "/1-2"))
    assert f"'{HUB}'" in found.summary


@pytest.mark.parametrize(
    ("camera", "arm"),
    [("/1-2", "/1-4"), ("/1-2/1-2.1", "/1-4"), ("/1-2/1-2.1", "/1-3/1-3.1"), ("/1-1", "/1-10/1-10.1")],
)
def test_ports_of_the_machine_are_no_shared_hub(camera: str, arm: str) -> None:
    assert shared_hub(identified(), artifacts(camera, arm, "/1-9")) == []


def test_only_what_is_commanded_counts() -> None:
    places = ("/1-2/1-2.1", "/1-2/1-2.4", "/1-2")
    plain: dict[str, Any] = {"classes": ["sound"]}
    assert shared_hub(identified("actuator", "audio_out"), artifacts(*places, **plain)) == []
    assert shared_hub(identified("sensor", "keyboard"), artifacts(*places, **plain)) == []
    assert shared_hub(identified("actuator", "machine"), artifacts(*places, **plain))
    modem = {"raw_descriptor": "bus: usb\ninterface 00: class 02/02/01"}
    assert shared_hub(identified("bidirectional", "serial"), artifacts(*places, **modem))
    assert shared_hub(identified(), Artifacts(probe={"devices": []})) == []
