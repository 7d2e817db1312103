"""macOS and WSL2 from recorded reports: what odd reports spoil, what is merged, and that PROBE keeps to itself."""

import json
import plistlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hosts.plant import plant
from jsonschema import Draft202012Validator

from octoform.builtin.probe import commands, is_mac, probe, probe_root
from octoform.builtin.probe.reader import Reader
from octoform.contracts.contract_check import check
from octoform.contracts.host_identity import pseudonymise
from octoform.contracts.model import Artifacts

SCHEMAS = Path(__file__).parents[3] / "protocol/schemas"
SCHEMA = json.loads((SCHEMAS / "probe.v1.schema.json").read_text())
PLATFORMS = ("macos-studio", "macos-older", "wsl2")
Planted = Callable[..., Path]
DEEP = "[" * 100_000


def probed(root: Path) -> Any:
    artifact: Any = probe_root(root)
    assert [error.message for error in Draft202012Validator(SCHEMA).iter_errors(artifact)] == []
    assert check("probe", artifact, Artifacts(), SCHEMAS) == []
    return artifact


def ids(artifact: Any) -> set[str]:
    return {device["id"] for device in artifact["devices"]}


def status(artifact: Any, words: str) -> str:
    return next(str(scan["status"]) for scan in artifact["scan_methods"] if scan["name"] == f"command:{words}")


def report(name: str, items: Any) -> tuple[str, str]:
    return f"system_profiler-{name}", json.dumps({name: items})


@pytest.mark.parametrize("name", PLATFORMS)
def test_such_a_host_says_that_it_was_only_tried_on_recordings(name: str, planted: Planted) -> None:
    assert probed(planted(name))["platform"]["verified"] == "recorded-only"


def test_other_hosts_are_not_marked(planted: Planted) -> None:
    assert "verified" not in probed(planted("laptop"))["platform"]


ODD_REPORTS = [
    ("system_profiler-SPUSBHostDataType", "no JSON"),
    ("system_profiler-SPUSBHostDataType", DEEP),
    ("system_profiler-SPUSBHostDataType", "[]"),
    ("system_profiler-SPUSBHostDataType", "17"),
    report("SPUSBHostDataType", {"_name": "no list"}),
    report("SPAudioDataType", [None, 17, "text", {"_items": {"no": "list"}}, {"_items": [[[]]], "_name": 5}]),
    report("SPDisplaysDataType", [{"_name": ["list"], "spdisplays_ndrvs": "none"}]),
    report("SPBluetoothDataType", [{"controller_properties": "off", "device_connected": [{"a": "b"}, "c"]}]),
    report("SPBluetoothDataType", [{"device_connected": [{"x": {"device_address": "../../etc"}}]}]),
    report("SPStorageDataType", [{"physical_drive": "none"}, {"physical_drive": {"device_name": 5}}]),
    report("SPNetworkDataType", [{"interface": True, "hardware": False, "Ethernet": ["no", "object"]}]),
    report("SPPowerDataType", [{"sppower_battery_model_info": "worn"}]),
    report("SPCameraDataType", [{}, {"_name": "\u202ecam\x1b[31m", "spcamera_unique-id": "0x" + "f" * 400}]),
    ("ioreg-IOUSBHostDevice", "<plist>"),
    ("ioreg-IOUSBHostDevice", "<plist><date>yesterday</date></plist>"),
    ("ioreg-IOUSBHostDevice", '<!DOCTYPE x [<!ENTITY a "aaaa">]><plist><string>&a;</string></plist>'),
    ("ioreg-IOUSBHostDevice", plistlib.dumps({"idVendor": "text", "idProduct": -1, "locationID": True}).decode()),
    ("ioreg-IOUSBHostDevice", plistlib.dumps([{"idVendor": 1 << 40, "locationID": 7, "bcdDevice": "x"}]).decode()),
    ("ioreg-IOSerialBSDClient", plistlib.dumps([{"IOCalloutDevice": "/dev/../etc/passwd"}]).decode()),
    ("sw_vers", "\0\0"),
]


@pytest.fixture(scope="module")
def mac(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The Mac of tests/hosts, planted once."""
    return plant("macos-studio", tmp_path_factory.mktemp("mac"))


@pytest.fixture
def replaced(mac: Path) -> Iterator[Callable[[str, str], Path]]:
    """``replaced(record, text)``: the Mac with another report in the place of that one, until the test is over."""
    kept: dict[Path, bytes] = {}

    def replace(record: str, said: str) -> Path:
        place = mac / "recorded/commands" / record
        kept[place] = place.read_bytes()
        place.write_text(said)
        return mac

    yield replace
    for place, data in kept.items():
        place.write_bytes(data)


@pytest.mark.parametrize(("record", "said"), ODD_REPORTS, ids=range(len(ODD_REPORTS)))
def test_an_odd_report_of_a_mac_spoils_at_most_itself(
    record: str, said: str, replaced: Callable[[str, str], Path]
) -> None:
    artifact = probed(replaced(record, said))
    assert {"macos-disk-marsh-ssd-ap1024", "usb-1d9c-0c14"} <= ids(artifact)
    assert {scan["status"] for scan in artifact["scan_methods"]} <= {"ok", "not_found", "error"}
    assert "ended without a result" not in {scan.get("detail") for scan in artifact["scan_methods"]}


def test_a_report_that_is_too_long_is_an_error(
    replaced: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(commands.output, "__defaults__", (20_000,))
    artifact = probed(replaced("system_profiler-SPCameraDataType", " " * 30_000))
    assert status(artifact, "system_profiler SPCameraDataType") == "error"
    assert "usb-1d9c-0c14" in ids(artifact)


def test_each_usb_device_of_a_mac_is_listed_once_whichever_report_shows_it(planted: Planted) -> None:
    root = planted("macos-studio")
    whole = {name for name in ids(probed(root)) if name.startswith("usb-")}
    assert len(whole) == 4
    (root / "recorded/commands/ioreg-IOUSBHostDevice").unlink()
    artifact = probed(root)
    assert status(artifact, "ioreg IOUSBHostDevice") == "not_found"
    assert {name for name in ids(artifact) if name.startswith("usb-")} == {"usb-1d00-2513", "usb-1d9c-0c14"}


def test_twins_on_a_mac_are_two_devices(planted: Planted) -> None:
    entries = [{"idVendor": 0x1D9C, "idProduct": 0x0C14, "locationID": 0x100000 * place} for place in (3, 2, 2)]
    root = planted("macos-older")
    (root / "recorded/commands/ioreg-IOUSBHostDevice").write_bytes(plistlib.dumps(entries))
    (root / "recorded/commands/system_profiler-SPUSBDataType").unlink()
    found = [device for device in probed(root)["devices"] if device["id"].startswith("usb-1d9c")]
    assert [device["id"] for device in found] == ["usb-1d9c-0c14", "usb-1d9c-0c14-2"]
    assert [device["instance"]["port"] for device in found] == ["0x00200000", "0x00300000"]


@pytest.mark.parametrize("name", PLATFORMS)
def test_what_would_be_committed_names_no_specimen_and_no_person(name: str, planted: Planted) -> None:
    artifact = probed(planted(name))
    shown = json.dumps(pseudonymise(artifact, b"key")).lower()
    instances = [device["instance"] for device in artifact["devices"]]
    secrets = [
        str(one[key]).lower() for one in instances for key in ("serial", "address") if len(str(one.get(key, ""))) > 5
    ]
    assert secrets
    assert [secret for secret in secrets if secret in shown] == []
    assert "anna" not in shown


@pytest.mark.parametrize(
    "said",
    [
        "",
        "null",
        "17",
        '"text"',
        '{"Class": 5, "InstanceId": ["USB"]}',
        '[{"InstanceId": "USB"}]',
        DEEP,
        "Get-PnpDevice: no",
    ],
)
def test_an_odd_answer_of_the_windows_side_spoils_nothing_of_linux(said: str, planted: Planted) -> None:
    root = planted("wsl2")
    for record in ("powershell-pnp", "usbipd-state"):
        (root / "recorded/commands" / record).write_text(said)
    assert "vmbus-hv-netvsc" in ids(probed(root))


def test_one_windows_device_alone_is_an_object_and_comes_with_a_byte_order_mark(planted: Planted) -> None:
    root = planted("wsl2")
    entry = {"Class": "Camera", "FriendlyName": "Lid Camera", "InstanceId": "USB\\VID_1D9C&PID_0C20&MI_00\\6&1&0&0000"}
    (root / "recorded/commands/powershell-pnp").write_text("\ufeff" + json.dumps(entry))
    (root / "recorded/commands/usbipd-state").unlink()
    artifact = probed(root)
    camera = next(device for device in artifact["devices"] if device["id"] == "windows-usb-1d9c-0c20")
    assert (camera["name"], camera["context"]) == ("Lid Camera", True)
    assert status(artifact, "usbipd.exe state") == "not_found"


def test_windows_is_asked_on_wsl2_alone(planted: Planted) -> None:
    names = {scan["name"] for scan in probed(planted("laptop"))["scan_methods"]}
    assert not any("powershell" in name or "usbipd" in name or "system_profiler" in name for name in names)
    assert {"command:bluetoothctl", "command:avahi-browse"} <= names


def test_a_running_mac_is_told_by_its_system_and_a_recorded_one_by_its_reports(planted: Planted) -> None:
    assert is_mac(Reader("/"), "darwin")
    assert not is_mac(Reader("/"), "linux")
    assert not is_mac(Reader(str(planted("laptop"))), "darwin")
    assert is_mac(Reader(str(planted("macos-older"))), "linux")


SOCKETLESS = """
import sys
touched = []
sys.addaudithook(lambda event, _: touched.append(event) if event.startswith("socket.") else None)
from pathlib import Path
from octoform.builtin.probe import probe_root
for root in sys.argv[1:]:
    probe_root(Path(root))
sys.exit(f"PROBE touched the network: {touched}" if touched else 0)
"""


def test_no_socket_is_opened_on_any_platform_the_running_one_included(planted: Planted) -> None:
    roots = [str(planted(name)) for name in ("laptop", *PLATFORMS)]
    command = [sys.executable, "-c", SOCKETLESS, *roots, "/"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_a_tool_that_hangs_costs_its_scan_and_no_device(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tool = tmp_path / "avahi-browse"
    tool.write_text("#!/bin/sh\nexec sleep 60\n")
    tool.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    started = time.monotonic()
    artifact: Any = probe(Reader("/"), 1.0)
    assert time.monotonic() - started < 60
    assert status(artifact, "avahi-browse") == "timeout"
    assert artifact["devices"]


def test_a_recorded_laptop_costs_little(planted: Planted) -> None:
    root = planted("laptop")
    probe_root(root)
    started = time.process_time()
    probe_root(root)
    assert time.process_time() - started < 0.3
