"""The invented hosts through PROBE and IDENTIFY: the artifact passes its contract, as `apply` would check it."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hosts.plant import NAMES, plant
from unit.builtin_identify.probes import answer, probe, usb

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.probe import probe_root
from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize("name", NAMES)
def test_the_contract_accepts_every_invented_host(name: str, tmp_path: Path) -> None:
    root = tmp_path / name
    plant(name, root)
    probed = probe_root(root)
    found = identify(probed, IdDatabases(root))
    assert check("identify", found, Artifacts(probe=probed), ROOT / "protocol/schemas") == []


@pytest.mark.parametrize("name", ["USB input device", "HID device", "serial sensor"])
@pytest.mark.parametrize("strings", [(), ("product: USB Device",)])
def test_the_class_of_a_pipe_names_no_kind_of_thing(name: str, strings: tuple[str, ...]) -> None:
    entry = usb(*strings, "interface 00: class 03/00/00 driver=usbhid", classes=["hid", "hidraw"], drivers=["usbhid"])
    fields = {"identified_as": name, "category": "sensor", "confidence": 0.3, "method": "kernel_class"}
    fields |= {"id": entry["id"], "evidence": [{"quote": "driver=usbhid"}], "capabilities": []}
    value = {"format": 1, "devices": [fields], "left_out": []}
    found = check("identify", value, Artifacts(probe=probe(entry)), ROOT / "protocol/schemas")
    assert [item.code for item in found] == ["IDENTIFY-GUESS"]


def test_the_laptop_is_known_by_name(tmp_path: Path) -> None:
    root = tmp_path / "laptop"
    plant("laptop", root)
    named = {device["identified_as"]: device for device in identify(probe_root(root), IdDatabases(root))["devices"]}
    assert "capture_image" in {capability["name"] for capability in named["Kestrel HD Camera"]["capabilities"]}
    assert named["Reed Cells RC-57"]["class"] == "battery"


def test_the_stage_runs_as_a_task_in_its_own_process(tmp_path: Path) -> None:
    probed = tmp_path / "probe.json"
    probed.write_text(json.dumps({"format": 1, "devices": [usb("product: USB Serial")]}), encoding="utf-8")
    output = tmp_path / "identify.json"
    task = tmp_path / "task.json"
    task.write_text(
        json.dumps({"format": 1, "stage": "identify", "input": str(probed), "output": str(output)}), encoding="utf-8"
    )
    environment = {**os.environ, "OCTOFORM_SYSROOT": str(tmp_path), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "octoform.builtin", str(task)]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=30, check=False)
    assert (ended.returncode, ended.stdout.strip()) == (0, "1 identified (1 unknown), 0 skipped")
    assert json.loads(output.read_text(encoding="utf-8"))["devices"] == [answer(usb("product: USB Serial"))]
