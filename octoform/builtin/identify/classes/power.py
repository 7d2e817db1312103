"""Power supplies of the kernel's class: batteries, chargers, mains, and what reports its battery over HID."""

from octoform.builtin.identify.evidence import Device, Fact
from octoform.builtin.identify.verdict import SENSOR, Capability, Claim

_VIA = "Linux power_supply class (/sys/class/power_supply)"


def claim(device: Device) -> Claim | None:
    """A battery or another supply, or nothing of the kind."""
    if "power_supply" not in device.classes:
        return None
    supplies = device.groups("power_supply")
    batteries = [_supply(group) for group in supplies if _type(group) in ("Battery", "UPS")]
    others = [_supply(group) for group in supplies if _type(group) not in ("Battery", "UPS")]
    capabilities = []
    if batteries:
        capabilities.append(
            Capability("read_battery", "Read charge, state and health of the battery.", _VIA,
                       parameters={"supplies": batteries})
        )  # fmt: skip
    if others:
        capabilities.append(
            Capability("read_power_supply", "Read whether the supply is connected, and what it delivers.", _VIA,
                       parameters={"supplies": others})
        )  # fmt: skip
    names = [
        (" ".join(part.text for part in (group.get("manufacturer"), group.get("model_name")) if part), _line(group))
        for group in supplies
    ]
    evidence = (device.cite("power_supply", "the kernel's power supply class"),)
    kind, noun = ("battery", "battery") if batteries else ("power_supply", "power supply")
    return Claim(kind, SENSOR, noun, evidence, tuple(capabilities), tuple(pair for pair in names if all(pair)))


def _type(group: dict[str, Fact]) -> str:
    return group["type"].text if "type" in group else ""


def _line(group: dict[str, Fact]) -> str:
    fact = group.get("model_name") or group.get("manufacturer")
    return fact.line if fact else ""


def _supply(group: dict[str, Fact]) -> dict[str, object]:
    readings = group["readings"].text.split(",") if "readings" in group else []
    return {"type": _type(group), "readings": readings}
