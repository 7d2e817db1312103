"""PROBE of the embedded agent: lists what a Linux kernel shows in text files; opens no device, judges nothing.

The stage itself is here: run every scan, make units of what they found, write the artifact.
"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from octoform.base.clock import stamp
from octoform.builtin.probe import device_units
from octoform.builtin.probe.commands import RECORDED
from octoform.builtin.probe.linux import Linux
from octoform.builtin.probe.reader import SCAN_SECONDS, Reader, run_all
from octoform.builtin.task import Task

if TYPE_CHECKING:
    from octoform.builtin.probe.macos import Macos

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
    host = _host(reader)
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


def _host(reader: Reader) -> "Linux | Macos":
    if not is_mac(reader, sys.platform):
        return Linux(reader)
    from octoform.builtin.probe.macos import Macos  # here, so that its parsers of property lists load on a Mac alone

    return Macos()


def is_mac(reader: Reader, system: str) -> bool:
    """Whether the root is that of a Mac: the running system, or a recorded one with the reports of one."""
    if not reader.root:
        return system == "darwin"
    return any(name.startswith(("system_profiler-", "ioreg-")) for name in reader.names_or_none(RECORDED))


def probe_root(root: Path) -> dict[str, Any]:
    """The PROBE artifact of a folder that holds sys, proc, dev and run, or a Mac's recorded reports."""
    return probe(Reader(str(root)))
