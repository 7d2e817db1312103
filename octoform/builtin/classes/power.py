"""Power supplies of the kernel's class: batteries, chargers, mains, and what reports its battery over HID."""

from octoform.builtin.description.class_model import (
    NUMBER,
    SENSOR,
    TEXT,
    WHOLE,
    Capability,
    Claim,
    Kind,
    listing,
    maybe,
    record,
)
from octoform.builtin.description.device_evidence import Device, Fact

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
    named = [[group[key] for key in ("manufacturer", "model_name") if key in group] for group in supplies]
    names = tuple(
        (" ".join(fact.text for fact in facts), *(fact.line for fact in facts))
        for facts in named
        if any(fact.key == "model_name" for fact in facts)
    )
    # Who made a supply is no name of it; what the board calls it is.
    own = device.fact("name") if device.bus in ("platform", "i2c") else None
    names = (*names, *(((own.text, own.line),) if own else ()))
    evidence = (device.cite("power_supply", "the kernel's power supply class"),)
    kind, noun = ("battery", "battery") if batteries else ("power_supply", "power supply")
    return Claim(kind, SENSOR, noun, evidence, tuple(capabilities), names)


def _type(group: dict[str, Fact]) -> str:
    return group["type"].text if "type" in group else ""


def _supply(group: dict[str, Fact]) -> dict[str, object]:
    readings = group["readings"].text.split(",") if "readings" in group else []
    return {"type": _type(group), "readings": readings}


# Batteries and other power supplies of the kernel's power_supply class.

SUPPLY = record(
    "Supply",
    name=TEXT,
    type=TEXT,
    status=maybe(TEXT),
    online=maybe(WHOLE),
    capacity_percent=maybe(NUMBER),
    voltage_v=maybe(NUMBER),
    current_a=maybe(NUMBER),
    power_w=maybe(NUMBER),
    energy_wh=maybe(NUMBER),
    energy_full_wh=maybe(NUMBER),
    charge_ah=maybe(NUMBER),
    charge_full_ah=maybe(NUMBER),
    temperature_degc=maybe(NUMBER),
    cycles=maybe(WHOLE),
    health=maybe(TEXT),
    technology=maybe(TEXT),
)
SUPPLIES = record("Supplies", device=TEXT, supplies=listing(SUPPLY))
_REST = "Null is not reported; online 1 is connected."

KINDS = (
    Kind("read_battery", f"Read charge, flow, health and temperature of the batteries. {_REST}", SUPPLIES, 80),
    Kind(
        "read_power_supply",
        f"Read whether the supplies are connected, and what they give. {_REST}",
        SUPPLIES,
        60,
    ),
)
