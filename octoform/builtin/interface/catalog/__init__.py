"""Every tool that the embedded agent can write, one module per class of device; their order is that of the server."""

from octoform.builtin.interface.catalog import (
    clock,
    controls,
    inputs,
    media,
    network,
    office,
    outputs,
    position,
    power,
    sensors,
    storage,
)
from octoform.builtin.interface.kinds import Kind

KINDS: dict[str, Kind] = {
    kind.name: kind
    for module in (media, sensors, position, power, controls, outputs, inputs, office, storage, network, clock)
    for kind in module.KINDS
}  # fmt: skip
