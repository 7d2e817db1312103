"""Small invented PROBE documents: one device each, as PROBE would write it."""

from pathlib import Path
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify

NO_DATABASES = IdDatabases(Path("/nonexistent"))


def usb(*lines: str, vid: str = "1d9c", pid: str = "0001", **more: Any) -> dict[str, Any]:
    """A USB device; ``lines`` follow its ids."""
    facts = ["bus: usb", f"vendor_id: {vid}", f"product_id: {pid}", *lines, "driver: usb"]
    return device(f"usb-{vid}-{pid}", "usb", *facts, vid=vid, pid=pid, **more)


def device(name: str, bus: str, *lines: str, **more: Any) -> dict[str, Any]:
    """Any unit; ``nodes`` are (class, name) pairs and also make its classes."""
    nodes = more.pop("nodes", ())
    entry: dict[str, Any] = {"id": name, "name": name, "interface": bus, "raw_descriptor": "\n".join(lines)}
    classes = sorted({kind for kind, _ in nodes} | set(more.pop("classes", ())))
    if classes:
        entry["classes"] = classes
    instance = {
        "sysfs": more.pop("sysfs", f"/sys/devices/{name}"),
        "nodes": [{"class": kind, "name": node} for kind, node in nodes],
    }
    return {**entry, **more, "instance": instance}


def probe(*devices: dict[str, Any]) -> dict[str, Any]:
    """The PROBE artifact of those devices."""
    return {
        "format": 1,
        "platform": {"os": "linux", "arch": "x86_64"},
        "scan_methods": [{"name": "sysfs:devices", "status": "ok"}],
        "devices": list(devices),
    }


def answer(entry: dict[str, Any], databases: IdDatabases = NO_DATABASES) -> dict[str, Any]:
    """The annotation of the one device, or its entry of ``left_out``."""
    found = identify(probe(entry), databases)
    entry = (found["devices"] or found["left_out"])[0]
    assert isinstance(entry, dict)
    return entry


def capabilities(annotation: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """The capabilities of an annotation by name."""
    return {capability["name"]: capability for capability in annotation["capabilities"]}
