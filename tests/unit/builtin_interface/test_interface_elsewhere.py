"""What macOS reports is not reported as lacking something of a Linux kernel."""

from typing import Any

import pytest

from octoform.builtin.interface import why_left_out


@pytest.mark.parametrize(
    ("category", "kind", "reason"),
    [("sensor", "camera", "no_standard_interface"), ("infrastructure", "storage", "bus_infrastructure")],
)
def test_a_device_of_macos_is_told_to_be_of_macos(category: str, kind: str, reason: str) -> None:
    device: dict[str, Any] = {"id": "macos-x", "category": category, "class": kind, "capabilities": []}
    assert why_left_out(device) == (reason, why_left_out({**device, "class": "audio"})[1])
    assert "macOS" in why_left_out(device)[1] and "kernel" not in why_left_out(device)[1]
    assert "kernel" in why_left_out({**device, "id": "usb-x"})[1]
