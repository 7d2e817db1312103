"""Says of device ids where they are attached now: a program for octoform's own commands, which touch no hardware.

``python -m octoform.runtime.where`` with {id: [classes]} as JSON on standard input and the runtime's environment; one
JSON object by id on standard output. Names in sysfs are read and nothing is opened.
"""

import json
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .base.files import parse
from .devices import device
from .faults import AmbiguousDevice, DeviceFault
from .rights import refused
from .sysfs import path_of, sysroot


def main() -> int:
    """Answer for every id that was asked for."""
    asked: Mapping[str, Iterable[str]] = parse(sys.stdin.read())
    print(json.dumps({name: whereabouts(name, classes) for name, classes in asked.items()}))
    return 0


def whereabouts(device_id: str, classes: Iterable[str] = ()) -> dict[str, Any]:
    """``attached``, ``port``, ``sysfs``, ``strength``, ``nodes``; ``doubt`` is why nothing would be moved with it.

    ``refused`` are the nodes that this user may not use (`octoform.runtime.rights.refused`).
    """
    answer: dict[str, Any] = {"attached": False, "port": "", "sysfs": "", "strength": "", "nodes": [], "doubt": ""}
    answer["refused"] = []
    try:
        found = device(device_id)
    except DeviceFault as problem:
        return {**answer, "doubt": str(problem)}
    kinds = [(kind, node) for kind in sorted(set(classes)) for node in found.nodes(kind)]
    nodes = dict.fromkeys(_on_host(node) for _, node in kinds)
    answer["refused"] = refused(kinds)
    where = {"attached": True, "port": found.folder.name, "sysfs": path_of(found.folder), "nodes": [*nodes]}
    answer = {**answer, **where, "strength": found.strength}
    try:
        acted_on = device(device_id, actuate=True)
    except AmbiguousDevice as problem:
        return {**answer, "doubt": str(problem)}
    except DeviceFault:  # it went away meanwhile
        return {**answer, "attached": False}
    return {**answer, "strength": acted_on.strength}


def _on_host(node: str) -> str:
    """A node as the host names it, without the system root."""
    return "/" + str(Path(node).relative_to(sysroot()))


if __name__ == "__main__":
    raise SystemExit(main())
