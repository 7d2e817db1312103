"""Batteries and other power supplies of the kernel's power_supply class."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import NUMBER, TEXT, WHOLE, listing, maybe, record

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
_REST = "Null is not told; online 1 is connected."

KINDS = (
    Kind("read_battery", f"Read charge, flow, health and temperature of the batteries. {_REST}", SUPPLIES, 80),
    Kind(
        "read_power_supply",
        f"Read whether the supplies are connected, and what they give. {_REST}",
        SUPPLIES,
        60,
    ),
)
