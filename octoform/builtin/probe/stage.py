"""The stage itself: run every scan, make units of what they found, write the artifact."""

import sys
from pathlib import Path
from typing import Any

from octoform.base.clock import stamp
from octoform.builtin.probe import device_units, macos
from octoform.builtin.probe.linux import Linux
from octoform.builtin.probe.macos import Macos
from octoform.builtin.probe.reader import SCAN_SECONDS, Reader, run_all
from octoform.builtin.task import Task

MAX_SCANS = 200
MAX_DEVICES = 20000


def run(task: Task) -> str:
    """Probe the task's system root and write the artifact; the summary line (``41 devices, 120 scans``)."""
    artifact = probe(Reader(str(task.sysroot)))
    task.write(artifact)
    devices, scans = artifact["devices"], artifact["scan_methods"]
    assert isinstance(devices, list) and isinstance(scans, list)
    return f"{len(devices)} devices, {len(scans)} scans"


def probe(reader: Reader, seconds: float = SCAN_SECONDS) -> dict[str, object]:
    """The PROBE artifact of the host below the reader's root; each scan gets at most ``seconds``."""
    host = Macos() if macos.is_here(reader, sys.platform) else Linux(reader)
    reports = run_all(host.scans()[:MAX_SCANS], reader, seconds)
    found = device_units.entries(host.units())
    return {
        "format": 1,
        "platform": host.platform,
        "hostname": host.hostname,
        "timestamp": stamp(),
        "scan_methods": [report.as_json() for report in reports],
        "devices": found[:MAX_DEVICES],
    }


def probe_root(root: Path) -> dict[str, Any]:
    """The PROBE artifact of a folder that holds sys, proc, dev and run, or a Mac's recorded reports."""
    return probe(Reader(str(root)))
