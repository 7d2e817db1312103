"""Block devices and displays: inventories that the kernel shows as text. No block device is ever opened."""

from octoform.builtin.interface.kinds import Kind
from octoform.builtin.interface.schemas import FLAG, NUMBER, TEXT, WHOLE, listing, maybe, record

VOLUME = record(
    "Volume", name=TEXT, size_bytes=WHOLE, mounted_at=maybe(TEXT), file_system=maybe(TEXT), free_bytes=maybe(WHOLE)
)
DISK = record(
    "Disk",
    name=TEXT,
    model=maybe(TEXT),
    size_bytes=WHOLE,
    rotational=maybe(FLAG),
    removable=maybe(FLAG),
    read_only=maybe(FLAG),
    state=maybe(TEXT),
    wear=maybe(TEXT),
    io_errors=maybe(WHOLE),
    temperature_degc=maybe(NUMBER),
    volumes=listing(VOLUME),
)
STORAGE = record("Storage", device=TEXT, disks=listing(DISK))
CONNECTOR = record(
    "Connector",
    name=TEXT,
    status=TEXT,
    enabled=maybe(TEXT),
    modes=listing(TEXT),
    manufacturer=maybe(TEXT),
    product=maybe(TEXT),
    width_mm=maybe(WHOLE),
    height_mm=maybe(WHOLE),
)
DISPLAYS = record("Displays", device=TEXT, connectors=listing(CONNECTOR))

KINDS = (
    Kind(
        "read_storage",
        "Read size, partitions, free space and what the kernel tells of health. What is not told is null.",
        STORAGE,
        60,
    ),
    Kind(
        "read_display",
        "Read which displays are connected, their names, size in mm and modes in pixels.",
        DISPLAYS,
        50,
    ),
)
