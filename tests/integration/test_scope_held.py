"""How far an agent reaches: neighbours stay outside, product knowledge is not assumed, many tools cause a warning.

An agent whose output is changed goes through the stages; an accepted output has its origin in the state.
"""

import json
from pathlib import Path
from typing import Any

import held
import pytest
from bench_host import lab
from cases import for_each
from held import Output, changed, refusals
from projects import Project
from sysfs_tree import Tree

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.probe import probe_root

pytestmark = pytest.mark.dear

CAMERA, SENSOR, NEAR, PAIRED = "usb-1f00-00c1", "hwmon-benchtemp", "network-neighbour", "bluetooth-paired"
NEIGHBOUR: Output = {"name": "neighbour", "interface": "network", "raw_descriptor": "state: reachable"}
HEADSET: Output = {"name": "paired device", "interface": "bluetooth", "raw_descriptor": "kind: audio\nprofile: 111e"}


def put(*members: Output) -> Any:
    return lambda value: value["devices"].extend(members)


def near(probe: Output) -> None:
    """What is merely near, as it should be listed."""
    put({"id": NEAR, **NEIGHBOUR, "context": True}, {"id": PAIRED, **HEADSET, "context": True})(probe)


def scanned(name: str, detail: str = "") -> Any:
    entry = {"name": name, "status": "ok", **({"detail": detail} if detail else {})}
    return lambda value: value["scan_methods"].append(entry)


def without(member: str) -> Any:
    return lambda value: value.pop(member)


def device(value: Output, name: str) -> Output:
    return next(each for each in value["devices"] if each["id"] == name)


PROBE: dict[str, tuple[Any, str]] = {
    "a neighbour without context": (put({"id": NEAR, **NEIGHBOUR}), "PROBE-NEIGHBOUR-NOT-CONTEXT"),
    "a headset that is paired": (put({"id": PAIRED, **HEADSET}), "PROBE-DEVICE-UNKNOWN"),
    "a neighbour by its address": (
        put({"id": "network-192-168-1-20", **NEIGHBOUR, "context": True}),
        "PROBE-SERIAL-IN-ID",
    ),
    "ports of neighbours": (scanned("nmap -p- 192.168.1.0/24"), "PROBE-NETWORK-SCAN"),
    "radios in range": (scanned("bluetooth", "bluetoothctl scan on for ten seconds"), "PROBE-NETWORK-SCAN"),
    "no host name": (without("hostname"), "PROBE-SCHEMA"),
    "no time": (without("timestamp"), "PROBE-SCHEMA"),
    "no platform": (without("platform"), "PROBE-SCHEMA"),
    "no scans": (without("scan_methods"), "PROBE-SCHEMA"),
    "no text of a device": (lambda value: device(value, CAMERA).pop("raw_descriptor"), "PROBE-SCHEMA"),
    "no bus of a device": (lambda value: device(value, CAMERA).pop("interface"), "PROBE-SCHEMA"),
    "a number that is none": (lambda value: device(value, CAMERA).update(vid="bench"), "PROBE-SCHEMA"),
    "a member of its own": (lambda value: value.update(devices_total=12), "PROBE-SCHEMA"),
}


def promoted(name: str, capability: str, via: str) -> Any:
    """A thing that is near, with something to do."""

    def change(value: Output) -> None:
        value["left_out"] = [each for each in value["left_out"] if each["id"] != name]
        able = {"name": capability, "description": "What it shows.", "via": via, "effect": "read"}
        text = "state: reachable" if name == NEAR else "kind: audio"
        value["devices"].append(
            {"id": name, "identified_as": "a thing nearby", "category": "sensor", "confidence": 0.4, "method": "none"}
            | {"evidence": [{"quote": text}], "capabilities": [able]}
        )

    return change


IDENTIFY: dict[str, tuple[Any, str]] = {
    "a neighbour that is read": (promoted(NEAR, "read_state", "snmp"), "IDENTIFY-NEIGHBOUR-PROMOTED"),
    "a headset without a way": (promoted(PAIRED, "record_audio", "bleak"), "IDENTIFY-NEIGHBOUR-PROMOTED"),
    "a network of ports": (
        lambda value: device(value, CAMERA)["capabilities"].append(
            {"name": "scan_ports", "description": "Open ports nearby.", "via": "nmap", "effect": "read"}
        ),
        "IDENTIFY-NEIGHBOUR-PROMOTED",
    ),
    "a product from memory": (
        lambda value: device(value, CAMERA).update(identified_as="Logitech BRIO", method="id_database", confidence=0.9),
        "IDENTIFY-NAME-WITHOUT-EVIDENCE",
    ),
    "a product by its number": (
        lambda value: device(value, CAMERA).update(
            identified_as="Bench Eye 4K",
            confidence=0.9,
            evidence=[{"quote": "product_id: 00c1", "says": "1f00:00c1 is the Bench Eye 4K"}],
        ),
        "IDENTIFY-NAME-WITHOUT-EVIDENCE",
    ),
}


@pytest.fixture(scope="module")
def probed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, dict[str, dict[str, str]]]:
    folder = tmp_path_factory.mktemp("near")
    host = lab(folder / "host")
    changes = [*(change for change, _ in PROBE.values()), near]
    project, errors = refusals(folder, host, "probe", {}, probe_root(host), changes, known=held.scanned(host))
    return project, dict(zip(PROBE, errors, strict=True))


@pytest.fixture(scope="module")
def identified(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, dict[str, dict[str, str]]]:
    folder = tmp_path_factory.mktemp("promoted")
    host = lab(folder / "host")
    probe = changed(probe_root(host), near)
    good = identify(probe, IdDatabases(host))
    changes = [*(change for change, _ in IDENTIFY.values()), lambda value: None]
    project, errors = refusals(
        folder, host, "identify", {"probe": probe}, good, changes, known=held.probed(host, probe)
    )
    return project, dict(zip(IDENTIFY, errors, strict=True))


@for_each("case", PROBE)
def test_what_is_near_is_told_as_such_and_what_a_device_has_is_told_whole(
    probed: tuple[Project, dict[str, dict[str, str]]], case: str
) -> None:
    assert PROBE[case][1] in probed[1][case], probed[1][case]


@for_each("case", IDENTIFY)
def test_nothing_near_is_used_and_no_product_is_known_beforehand(
    identified: tuple[Project, dict[str, dict[str, str]]], case: str
) -> None:
    assert IDENTIFY[case][1] in identified[1][case], identified[1][case]


def test_neighbours_are_context_in_what_is_accepted_and_are_used_by_nothing(
    probed: tuple[Project, dict[str, dict[str, str]]], identified: tuple[Project, dict[str, dict[str, str]]]
) -> None:
    committed = json.loads((probed[0].state / "probe" / "output.json").read_text())
    assert {each["id"] for each in committed["devices"] if each.get("context")} == {NEAR, PAIRED}
    found = json.loads((identified[0].state / "identify" / "output.json").read_text())
    assert {NEAR, PAIRED} <= {each["id"] for each in found["left_out"]}


def test_an_accepted_artifact_says_what_made_it_and_the_platform_is_that_of_the_host(tmp_path: Path) -> None:
    """The agent spells the platform otherwise; what the state keeps is what the host shows."""
    states = []
    for name, text in (("one", ""), ("other", "\nLook twice.\n")):
        project = Project(tmp_path / name / "project", tmp_path / name / "outside")
        specs = project.own_specs()
        (specs / "watch.md").write_text((specs / "watch.md").read_text() + text)
        project.script = {"probe": [{"mutate": [[["platform"], {"os": "Linux", "arch": "amd64", "os_id": "Debian"}]]}]}
        project.apply("-target", "interface", status=0)
        states.append(project.nodes())
    for stage in ("probe", "identify", "interface"):
        one, other = (state[stage] for state in states)
        assert (one["harness"], one["key_parts"]["harness"].split()[0]) == ("command", "command")
        assert {"os", "os_id", "os_version", "arch"} <= one["platform"].keys()
        assert (one["platform"]["os"], one["platform"]["os_id"]) == ("linux", "debian")
        assert one["specs"].startswith("sha256:") and one["specs"] != other["specs"], "the whole tree of specs"
        assert one["output_digest"] == other["output_digest"]


def many(root: Path, count: int) -> Path:
    """A host with so many sensors of its board."""
    lab(root)
    tree = Tree(root)
    for at in range(1, count + 1):
        place = f"platform/sensor{at}.0/hwmon/hwmon{at}"
        tree.member(place, "hwmon", {"name": f"sensor{at}", "temp1_label": "case", "temp1_input": "21500"})
    return root


def test_more_than_an_agent_can_choose_from_is_warned_of_and_accepted(tmp_path: Path) -> None:
    host = many(tmp_path / "host", 41)
    project = Project(tmp_path / "project", tmp_path / "outside")
    project.environ["OCTOFORM_SYSROOT"] = str(host)
    probe = probe_root(host)
    found = identify(probe, IdDatabases(host))
    extra = [
        {
            "name": f"read_{word}_temperature",
            "description": f"The temperature {word}.",
            "via": "hwmon",
            "effect": "read",
        }
        for word in ("mean", "lowest", "highest", "first", "last")
    ]
    device(found, SENSOR)["capabilities"] += extra
    project.script = {"probe": [{"write": json.dumps(probe)}], "identify": [{"write": json.dumps(found)}]}
    done = project.apply("-target", "identify", status=0)
    assert {"IDENTIFY-MANY-DEVICES", "IDENTIFY-MANY-CAPABILITIES"} <= set(done.codes())
    fields = {
        item["code"]: item for event in done.events() for item in [event.get("diagnostic") or {}] if "code" in item
    }
    assert fields["IDENTIFY-MANY-DEVICES"]["severity"] == "warning"
    assert "two to five" in fields["IDENTIFY-MANY-CAPABILITIES"]["summary"]
    assert project.nodes()["identify"]["status"] == "accepted"
