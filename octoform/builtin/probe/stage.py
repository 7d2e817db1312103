"""The stage itself: run every scan, make units of what they found, write the artifact."""

import datetime
from pathlib import Path

from octoform.builtin.probe import units
from octoform.builtin.probe.context import Context
from octoform.builtin.probe.reader import Reader
from octoform.builtin.probe.scans import SCAN_SECONDS, Scan, run_all
from octoform.builtin.probe.sysfs import Sysfs
from octoform.builtin.probe.udev import UdevDatabase
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
    udev = UdevDatabase()
    sysfs = Sysfs(udev)
    context = Context(sysfs.nodes)
    scans = [Scan("udev:db", udev.scan), *sysfs.scans(reader.fresh()), *context.scans()][:MAX_SCANS]
    reports = run_all(scans, reader, seconds)
    found = units.entries([*units.collect(dict(sysfs.nodes)), *context.units()])
    now = datetime.datetime.now(datetime.UTC).replace(microsecond=0)
    return {
        "format": 1,
        "platform": context.platform,
        "hostname": context.hostname,
        "timestamp": now.isoformat().replace("+00:00", "Z"),
        "scan_methods": [report.as_json() for report in reports],
        "devices": found[:MAX_DEVICES],
    }


def probe_root(root: Path) -> dict[str, object]:
    """The PROBE artifact of a folder that holds sys, proc, dev and run."""
    return probe(Reader(str(root)))
