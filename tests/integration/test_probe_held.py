"""PROBE of an agent that gets it wrong, on a host that shows otherwise: each attempt is refused with the true line."""

import copy
import json
from collections.abc import Callable
from typing import Any

import pytest
from bench_host import SERIAL, lab
from cases import for_each
from held import refusals, scanned
from projects import Project

from octoform.builtin.probe import probe_root

CAMERA, STICK, TOUCH, BUS = "usb-1f00-00c1", "usb-1f00-00d1", "hid-1f00-0077", "platform-amdi0010"
Probe = dict[str, Any]


def found(probe: Probe, device: str) -> Probe:
    return next(each for each in probe["devices"] if each["id"] == device)


def changed(device: str, **members: Any) -> Callable[[Probe], None]:
    return lambda probe: found(probe, device).update(members)


def added(line: str, device: str = CAMERA) -> Callable[[Probe], None]:
    def change(probe: Probe) -> None:
        found(probe, device)["raw_descriptor"] += f"\n{line}"

    return change


def emptied(probe: Probe) -> None:
    probe["devices"] = []


def invented(probe: Probe) -> None:
    more = {"id": "usb-1f00-0a12", "name": "Robot arm", "interface": "usb", "raw_descriptor": "x: y", "vid": "1f00"}
    probe["devices"].append({**more, "pid": "0a12"})


def doubled(probe: Probe) -> None:
    probe["devices"].append({**copy.deepcopy(found(probe, CAMERA)), "id": f"{CAMERA}-2"})


def camera_left_out(probe: Probe) -> None:
    probe["devices"].remove(found(probe, CAMERA))


def scans_left_out(probe: Probe) -> None:
    probe["scan_methods"] = [{"name": "inventory of hwmon, hid, platform, scsi", "status": "ok"}]


def scan_denied(probe: Probe) -> None:
    probe["scan_methods"] = [{**each, "status": "denied"} for each in probe["scan_methods"] if "usb" in each["name"]]
    probe["scan_methods"].append({"name": "inventory of hwmon, hid, platform, scsi", "status": "ok"})


def installed(probe: Probe) -> None:
    probe["scan_methods"].append({"name": "lsusb", "status": "ok", "detail": "after apt-get install usbutils"})


def relabelled(probe: Probe) -> None:
    probe["platform"]["os_version"] = "13"


def twice(probe: Probe) -> None:
    probe["left_out"] = [{"id": CAMERA, "reason": "nobody asks for it"}]


WRONG: dict[str, tuple[Callable[[Probe], None], str, str]] = {
    "an empty list": (emptied, "PROBE-DEVICE-MISSING", CAMERA),
    "an invented device": (invented, "PROBE-DEVICE-UNKNOWN", "the host shows no device"),
    "other numbers": (changed(CAMERA, pid="00c2"), "PROBE-CONTRADICTED", "'00c1'"),
    "one device twice": (doubled, "PROBE-DEVICE-UNKNOWN", "one too many"),
    "a camera skipped": (camera_left_out, "PROBE-DEVICE-MISSING", "Bench Cam"),
    "an interpretation": (added("kind: pan and tilt robot"), "PROBE-TEXT-NOT-OF-HOST", "'robot'"),
    "an interpretation as a key": (added("robot arm: bench"), "PROBE-TEXT-NOT-OF-HOST", "'arm'"),
    "a name from memory": (changed(CAMERA, name="Example BRIO"), "PROBE-TEXT-NOT-OF-HOST", "'brio'"),
    "a reading": (added("temp1_input: 21500", "hwmon-benchtemp"), "PROBE-TEXT-NOT-OF-HOST", "'21500'"),
    "a port in an id": (changed(CAMERA, id="usb-1-2"), "PROBE-DEVICE-UNKNOWN", f"calls it '{CAMERA}'"),
    "a driver's word for an id": (
        changed(TOUCH, id="hid-hid-multitouch", vid=None, pid=None, instance={}),
        "PROBE-DEVICE-UNKNOWN",
        f"calls it '{TOUCH}'",
    ),
    "the number of an ACPI id": (changed(f"{BUS}-2", id=f"{BUS}-1"), "PROBE-DEVICE-UNKNOWN", f"calls it '{BUS}-2'"),
    "the class of another unit": (changed(STICK, classes=["block"]), "PROBE-CONTRADICTED", "none"),
    "a class skipped": (changed(CAMERA, classes=[]), "PROBE-CONTRADICTED", "video4linux"),
    "another driver": (changed(CAMERA, drivers=["gspca"]), "PROBE-CONTRADICTED", "uvcvideo"),
    "another serial number": (
        changed(CAMERA, instance={"serial": "CAM-99999"}),
        "PROBE-CONTRADICTED",
        "instance.serial",
    ),
    "a device called a neighbour": (changed(CAMERA, context=True), "PROBE-CONTRADICTED", "context"),
    "another system": (relabelled, "PROBE-CONTRADICTED", "'12'"),
    "a scan skipped": (scans_left_out, "PROBE-SCAN-UNTOLD", "'usb'"),
    "devices of a scan that was denied": (scan_denied, "PROBE-SCAN-UNTOLD", "'usb'"),
    "listed and skipped": (twice, "PROBE-LEFT-OUT", "listed as well"),
    "a program that was installed": (installed, "PROBE-INSTALLED", "not_found"),
}


def kinds_only(probe: Probe) -> None:
    """What an agent may do: write less, reword, omit with a reason, list a neighbour."""
    for device in probe["devices"]:
        device.pop("instance")
        device.pop("drivers", None)
    camera = found(probe, CAMERA)
    camera["raw_descriptor"] = f"idVendor: 0x1F00\nidProduct: 0x00c1\niProduct: Bench Cam {SERIAL}\nDriver: uvcvideo"
    probe["devices"].remove(found(probe, STICK))
    probe["left_out"] = [{"id": STICK, "reason": "a person carries it away"}]
    near = {"id": "net-neighbour", "name": "neighbour", "interface": "network", "raw_descriptor": "state: reachable"}
    probe["devices"].append({**near, "context": True})


@pytest.fixture(scope="module")
def applied(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, dict[str, dict[str, str]]]:
    """Runs of PROBE whose attempts are all of `WRONG`, then `kinds_only`; the errors of each attempt."""
    folder = tmp_path_factory.mktemp("held")
    host = lab(folder / "host")
    changes = [*(change for change, _, _ in WRONG.values()), kinds_only]
    project, errors = refusals(folder, host, "probe", {}, probe_root(host), changes, known=scanned(host))
    return project, dict(zip(WRONG, errors, strict=True))


@for_each("case", WRONG, every=3, kind=lambda case: WRONG[case][1])
def test_what_the_host_contradicts_is_refused_with_the_true_line(
    applied: tuple[Project, dict[str, dict[str, str]]], case: str
) -> None:
    _, code, value = WRONG[case]
    result = applied[1][case]
    assert code in result and value in result[code], result


def test_what_is_accepted_bears_the_hosts_own_facts_and_hides_a_number_that_stands_in_a_text_alone(
    applied: tuple[Project, dict[str, dict[str, str]]],
) -> None:
    project, _ = applied
    committed = (project.state / "probe" / "output.json").read_text()
    assert SERIAL not in committed and "redacted-" in found(json.loads(committed), CAMERA)["raw_descriptor"]
    ledger = json.loads((project.local / "instances.json").read_text())["devices"][CAMERA]
    assert (ledger["serial"], ledger["port"], ledger["strength"]) == (SERIAL, "1-2", "strong")
