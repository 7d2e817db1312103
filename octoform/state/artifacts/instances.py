"""The ledger of instances: which serial number, port and node each device id has on this very machine.

Git gets kinds only; this file keeps what differs between two machines of one kind, readable by its owner alone. The
generated server's runtime reads it at call time. Light.
"""

from octoform.base.files import parse
from octoform.base.shape import INSTANCES as FORM
from octoform.base.shape import fits
import json
from collections.abc import Mapping

from octoform.diagnostics import Diagnostic, error
from octoform.state.files import make_folders, read_regular, shown, write_atomic
from octoform.state.artifacts.cache import INSTANCES, keep
from octoform.state.layout import Layout

FORMAT = 1


def write_instances(layout: Layout, devices: Mapping[str, object]) -> list[Diagnostic]:
    """Write device id to instance, mode 0600 in a folder of mode 0700; empty list when it is on disk."""
    document = {"format": FORMAT, "devices": dict(devices)}
    text = json.dumps(document, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    data = text.encode("utf-8", "surrogatepass")
    problem = make_folders(layout) or write_atomic(layout.instances, data, 0o600)
    if problem is not None:
        return [problem]
    keep(layout, INSTANCES, {layout.instances.name: data})  # without room for a copy the ledger stands all the same
    return []


def classes_of(instance: object) -> list[str]:
    """The classes of a device's nodes, as its entry in the ledger has them; empty where it has none."""
    nodes = instance.get("nodes") if isinstance(instance, Mapping) else None
    return sorted({str(item["class"]) for item in nodes or () if item.get("class")})


def read_instances(layout: Layout) -> tuple[dict[str, object] | None, list[Diagnostic]]:
    """Device id to instance; (None, []) when PROBE was never accepted on this machine."""
    data, problem = read_regular(layout.instances)
    if data is None:
        return None, [problem] if problem is not None else []
    try:
        found = parse(data, any_text=False)
    except ValueError:
        found = None
    if fits(found, FORM) and found["format"] == FORMAT:
        return found["devices"], []
    hint = "run `octoform apply -replace probe`: PROBE writes it anew"
    return None, [error("STATE-INSTANCES", "this is no ledger of instances", path=shown(layout.instances), hint=hint)]
