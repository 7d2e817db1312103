"""Network adapters and Bluetooth adapters: their state as the kernel shows it. Nothing is sent, switched or paired."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import FLAG, TEXT, WHOLE, listing, maybe, record

INTERFACE = record(
    "NetworkInterface",
    name=TEXT,
    state=TEXT,
    carrier=maybe(FLAG),
    wireless=FLAG,
    speed_mbps=maybe(WHOLE),
    duplex=maybe(TEXT),
    mtu=maybe(WHOLE),
    received_bytes=maybe(WHOLE),
    sent_bytes=maybe(WHOLE),
    receive_errors=maybe(WHOLE),
    send_errors=maybe(WHOLE),
)
INTERFACES = record("NetworkInterfaces", device=TEXT, interfaces=listing(INTERFACE))
RADIO = record(
    "BluetoothRadio",
    name=TEXT,
    switched_off=maybe(FLAG),
    blocked_by_hardware=maybe(FLAG),
    connections=WHOLE,
    paired=maybe(listing(TEXT)),
)
RADIOS = record("BluetoothRadios", device=TEXT, radios=listing(RADIO))

KINDS = (
    Kind(
        "read_network_interfaces",
        "Read state, link speed in Mbit/s and traffic counters of the adapter's network interfaces.",
        INTERFACES,
        40,
    ),
    Kind(
        "read_bluetooth",
        "Read whether the Bluetooth adapter is switched off, its open connections, and the names of paired devices "
        "(null where only root may read them).",
        RADIOS,
        35,
    ),
)
