"""Scans are boxed in time and in what they may open: drivers that hang, folders that refuse, no node of /dev."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from octoform.builtin.probe import probe
from octoform.builtin.probe.reader import Abandoned, Reader, Scan, run_all, run_one

Planted = Callable[..., Path]
AUDITED = """
import json, sys
opened = []
def hook(event, arguments):
    if event in ("open", "os.open"):
        opened.append(str(arguments[0]))
    if event.startswith(("subprocess", "os.exec", "os.posix_spawn", "os.system", "socket.connect")):
        opened.append("RAN " + event)
sys.addaudithook(hook)
from octoform.builtin.__main__ import main
status = main([sys.argv[1]])
print(json.dumps([path for path in opened if path.startswith(sys.argv[2]) or path.startswith(("/dev", "RAN"))]))
sys.exit(status)
"""


class Hanging(Reader):
    """A reader for which one file never answers until the test lets it."""

    def __init__(self, root: str, suffix: str, released: threading.Event) -> None:
        super().__init__(root)
        self.suffix, self.released = suffix, released

    def fresh(self) -> "Hanging":
        return Hanging(self.root, self.suffix, self.released)

    def data(self, path: str, limit: int = 4096) -> bytes | None:
        if path.endswith(self.suffix):
            self.released.wait()
        return super().data(path, limit)


def test_a_driver_that_hangs_costs_its_scan_and_hides_no_device(planted: Planted) -> None:
    released = threading.Event()
    root = planted("laptop")
    try:
        artifact: Any = probe(Hanging(str(root), "hwmon4/name", released), seconds=0.3)
        before = json.dumps(artifact)
    finally:
        released.set()
    scans = {scan["name"]: scan for scan in artifact["scan_methods"]}
    assert scans["sysfs:class/hwmon"]["status"] == "timeout"
    assert scans["sysfs:class/video4linux"]["status"] == "ok"
    sensor = next(device for device in artifact["devices"] if device["id"] == "platform-coretemp")
    assert sensor["classes"] == ["hwmon"]
    assert json.dumps(artifact) == before


def test_an_answer_that_comes_too_late_reaches_nothing() -> None:
    released, ended = threading.Event(), threading.Event()
    found: list[str] = []

    def look(reader: Reader) -> None:
        released.wait()
        try:
            found.append(reader.text("/nowhere"))
        except Abandoned:
            ended.set()
            raise

    report = run_one(Scan("slow", look), Reader("/nowhere"), 0.05)
    released.set()
    assert ended.wait(10)
    assert (report.status, found) == ("timeout", [])


@pytest.mark.parametrize(
    ("problem", "status"),
    [
        (FileNotFoundError(2, "gone"), "not_found"),
        (PermissionError(13, "Permission denied"), "denied"),
        (OSError(5, "Input/output error"), "error"),
        (ValueError("odd"), "error"),
    ],
)
def test_a_scan_that_fails_says_how_and_the_next_one_runs(problem: Exception, status: str) -> None:
    def fail(_reader: Reader) -> None:
        raise problem

    reports = run_all([Scan("bad", fail), Scan("good", lambda _reader: None)], Reader("/"), 10)
    assert [(report.name, report.status) for report in reports] == [("bad", status), ("good", "ok")]


def test_the_reader_refuses_everything_below_dev(tmp_path: Path) -> None:
    (tmp_path / "dev").mkdir()
    (tmp_path / "dev/ttyS0").write_text("never")
    with pytest.raises(ValueError, match="/dev"):
        Reader(str(tmp_path)).data("/dev/ttyS0")
    assert Reader(str(tmp_path)).names("/dev") == ["ttyS0"]


def test_the_reader_follows_no_link_out_of_an_attribute(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    (tmp_path / "name").symlink_to(tmp_path / "secret")
    os.mkfifo(tmp_path / "pipe")
    reader = Reader(str(tmp_path))
    assert reader.data("/name") is None
    assert reader.text("/pipe") == ""


@pytest.mark.parametrize("name", ["laptop", "bench", "hostile"])
def test_a_whole_run_opens_no_device_node_and_starts_nothing(name: str, planted: Planted, tmp_path: Path) -> None:
    root = planted(name)
    task = {"format": 1, "stage": "probe", "input": None, "schema": None, "output": str(tmp_path / "output.json")}
    (tmp_path / "task.json").write_text(json.dumps(task))
    done = subprocess.run(
        [sys.executable, "-c", AUDITED, str(tmp_path / "task.json"), str(root / "dev")],
        env={**os.environ, "OCTOFORM_SYSROOT": str(root)},
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr
    summary, opened = done.stdout.splitlines()
    assert json.loads(opened) == []
    artifact = json.loads((tmp_path / "output.json").read_text())
    assert summary == f"{len(artifact['devices'])} devices, {len(artifact['scan_methods'])} scans"


def test_links_that_lead_out_of_the_device_tree_are_no_devices(tmp_path: Path) -> None:
    folder = tmp_path / "sys/class/hwmon"
    folder.mkdir(parents=True)
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/name").write_text("secret")
    (folder / "hwmon0").symlink_to("../../../outside")
    (folder / "hwmon1").symlink_to("../../devices/../../outside")
    (folder / "hwmon2").symlink_to("/etc")
    artifact: Any = probe(Reader(str(tmp_path)))
    assert artifact["devices"] == []


def test_a_host_with_very_many_classes_loses_none(tmp_path: Path) -> None:
    for number in range(300):
        device = tmp_path / f"sys/devices/platform/box/kind{number}/thing{number}"
        device.mkdir(parents=True)
        folder = tmp_path / f"sys/class/kind{number}"
        folder.mkdir(parents=True)
        (folder / device.name).symlink_to(f"../../devices/platform/box/kind{number}/thing{number}")
    artifact: Any = probe(Reader(str(tmp_path)))
    assert len(artifact["scan_methods"]) <= 200
    assert len(artifact["devices"]) == 300
    assert {"platform", "proc:net/arp"} <= {scan["name"] for scan in artifact["scan_methods"]}
