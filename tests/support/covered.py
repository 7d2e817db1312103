"""Reports of coverage for tests: artifacts made by hand or by the embedded agent's stages, and the report on them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe import probe_root
from octoform.engine.coverage import CoverageReport, Ground, Stage, coverage
from octoform.engine.coverage_runs import Pass, Run, compare, run_of

STAMP = "2026-01-02T03:04:05Z"


def onboarded(root: Path) -> dict[str, Any]:
    """The artifacts that the embedded agent makes of a planted host, up to INTERFACE."""
    probed: Any = probe_root(root)
    identified = identify(probed, IdDatabases(root))
    return {"probe": probed, "identify": identified, "interface": declare(identified, 30)}


def seen(name: str, called: str = "") -> dict[str, Any]:
    return {"id": name, "name": called or name, "interface": "usb", "raw_descriptor": called or name}


def known(name: str, category: str = "sensor", *able: str, **more: Any) -> dict[str, Any]:
    """A device of IDENTIFY."""
    capabilities = [{"name": one, "description": one, "via": f"way of {one}", "effect": "read"} for one in able]
    fields = {"identified_as": f"the {name}", "class": "thing", "confidence": 0.8, "method": "kernel_class"}
    return {"id": name, "category": category, **fields, "evidence": [], "capabilities": capabilities, **more}


def left(name: str, reason: str, detail: str = "") -> dict[str, Any]:
    return {"id": name, "reason": reason, **({"detail": detail} if detail else {})}


def identified(devices: Sequence[Mapping[str, Any]], out: Sequence[Mapping[str, Any]] = ()) -> dict[str, Any]:
    return {"format": 1, "devices": list(devices), "left_out": list(out)}


def declared(identify: Mapping[str, Any], out: Sequence[Mapping[str, Any]] = (), **names: str) -> dict[str, Any]:
    """An INTERFACE with a tool for each capability; ``names`` call the tool of a capability something else."""
    owners: dict[str, list[str]] = {}
    for device in identify["devices"]:
        for one in device["capabilities"]:
            owners.setdefault(one["name"], []).append(device["id"])
    tools = [
        {"name": names.get(name, name), "capability": name, "devices": ids, "effect": "read"}
        for name, ids in owners.items()
    ]
    without = [left(item["id"], "no_function") for item in identify["devices"] if not item["capabilities"]]
    return {"format": 1, "tools": tools, "left_out": [*identify["left_out"], *without, *out]}


def report(artifacts: Mapping[str, Any], runs: Sequence[Run] = (), **ground: Any) -> CoverageReport:
    """A report whose times and usage are always the same."""
    compared = runs or [run_of("builtin", artifacts["identify"], artifacts.get("interface"))]
    found = coverage(Ground(artifacts, **ground))
    names = [name for name in ("probe", "identify", "interface", "serve", "deploy") if name in artifacts]
    stages = tuple(Stage(name, "builtin", 1, 0.2, STAMP, None, None, None) for name in names)
    counts = (found.funnel.enumerated, found.funnel.annotated, found.funnel.unknown, found.funnel.tools)
    taken = Pass(1, STAMP, "accepted", tuple(names), ("builtin",), len(names), 0, 0.6, *counts)
    platform = {name: value for name, value in artifacts["probe"]["platform"].items() if name != "kernel"}
    notes = ("not there yet: SERVE, DEPLOY; octoform apply makes it; no tool can be called until then",)
    return CoverageReport(platform, found, compare(compared), stages, (taken,), "absent", notes)
