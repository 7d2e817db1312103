"""PROBE of the invented hosts: the schema, the expected facts, nothing of the instance in what describes the kind."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hosts.plant import HERE, NAMES
from jsonschema import Draft202012Validator

from octoform.builtin.probe import probe_root

SCHEMA = json.loads((Path(__file__).parents[3] / "protocol/schemas/probe.v1.schema.json").read_text())
Planted = Callable[..., Path]


def canonical(artifact: dict[str, Any]) -> str:
    """The artifact without what is marked instance or volatile in its schema."""
    kept = copy.deepcopy(artifact)
    for key in ("hostname", "timestamp"):
        kept.pop(key, None)
    kept["platform"].pop("kernel", None)
    for scan in kept["scan_methods"]:
        del scan["duration_ms"]
    for device in kept["devices"]:
        del device["instance"]
    return json.dumps(kept, indent=1)


def lines(device: dict[str, Any]) -> list[str]:
    return str(device["raw_descriptor"]).split("\n")


@pytest.mark.parametrize("name", NAMES)
def test_a_host_passes_the_schema_with_unique_ids(name: str, planted: Planted) -> None:
    artifact: Any = probe_root(planted(name))
    assert [error.message for error in Draft202012Validator(SCHEMA).iter_errors(artifact)] == []
    ids = [device["id"] for device in artifact["devices"]]
    assert len(ids) == len(set(ids))


@pytest.mark.parametrize("name", NAMES)
def test_a_host_shows_what_is_expected_of_it(name: str, planted: Planted) -> None:
    artifact: Any = probe_root(planted(name))
    expected = json.loads((HERE / f"{name}.expect.json").read_text())
    assert artifact["hostname"] == expected["hostname"]
    assert artifact["platform"] == expected["platform"]
    found = {device["id"]: device for device in artifact["devices"]}
    for identity, facts in expected["devices"].items():
        device = found[identity]
        assert [line for line in facts.pop("lines", []) if line not in lines(device)] == [], device["raw_descriptor"]
        instance = facts.pop("instance", {})
        assert {key: device["instance"].get(key) for key in instance} == instance
        nodes = {node.get("node") for node in device["instance"]["nodes"]}
        assert set(facts.pop("nodes", [])) - nodes == set()
        assert {key: device.get(key) for key in facts} == facts
    text = json.dumps(artifact, ensure_ascii=False)
    assert [word for word in expected["absent"] if word in text] == []


@pytest.mark.parametrize("name", NAMES)
def test_every_device_of_sysfs_belongs_to_exactly_one_unit(name: str, planted: Planted) -> None:
    root = planted(name)
    links = [*root.glob("sys/bus/*/devices/*"), *root.glob("sys/class/*/*")]
    shown = {"/" + str(link.resolve().relative_to(root.resolve())) for link in links}
    artifact: Any = probe_root(root)
    listed = [path for device in artifact["devices"] for path in device["instance"]["paths"]]
    heads = {device["instance"].get("sysfs") for device in artifact["devices"]}
    assert shown - heads - set(listed) == set()
    assert len(listed) == len(set(listed))


@pytest.mark.parametrize("name", NAMES)
def test_two_runs_say_the_same(name: str, planted: Planted) -> None:
    root = planted(name)
    first: Any = probe_root(root)
    again: Any = probe_root(root)
    assert canonical(first) == canonical(again)
    assert [device["instance"] for device in first["devices"]] == [device["instance"] for device in again["devices"]]


def test_other_ports_serials_and_names_are_the_same_kinds(planted: Planted) -> None:
    other = planted(
        "laptop",
        {
            "usb1/1-5": "usb1/1-9",
            "/1-5:1.": "/1-9:1.",
            "KO-200417": "KO-7",
            "BATT-00417": "BATT-1",
            "RNV-0001733": "RNV-2",
            "0000:02:00.0": "0000:07:00.0",
            "hwmon/hwmon4": "hwmon/hwmon11",
            "input/input3": "input/input9",
            "input3::capslock": "input9::capslock",
            "02:00:5e:10:00:aa": "02:00:5e:10:00:bb",
            "192.0.2.1 ": "192.0.2.9 ",
            "heron\n": "egret\n",
            "loop{0..7}": "loop{0..31}",
            "6.6.0-example": "6.7.1-example",
        },
    )
    assert canonical(probe_root(other)) == canonical(probe_root(planted("laptop")))


def test_devices_that_changed_places_keep_their_ids(planted: Planted) -> None:
    swapped = planted("bench", {"usb1/1-10": "usb1/1-0", "/1-10:1.": "/1-0:1.", "usb1/1-3": "usb1/1-30"})
    assert canonical(probe_root(swapped)) == canonical(probe_root(planted("bench")))


def test_no_serial_number_or_address_stands_outside_the_instance(planted: Planted) -> None:
    for name in NAMES:
        artifact: Any = probe_root(planted(name))
        for device in artifact["devices"]:
            secrets = [device["instance"].get(key, "") for key in ("serial", "address")]
            shown = json.dumps({key: value for key, value in device.items() if key != "instance"})
            assert [secret for secret in secrets if len(secret) > 5 and secret in shown] == []


def test_text_is_bounded_and_of_one_line_a_fact(planted: Planted) -> None:
    artifact: Any = probe_root(planted("hostile"))
    for device in artifact["devices"]:
        assert len(device["raw_descriptor"]) <= 4000
        assert all(": " in line for line in lines(device))
        assert device["name"].isprintable() and device["raw_descriptor"].replace("\n", "").isprintable()
    # A device cannot add a fact of its own by putting a line end into its name.
    cheat = next(device for device in artifact["devices"] if device["id"] == "usb-1d9c-0bad")
    assert "vendor_id: dead" not in lines(cheat)


def test_a_failed_read_is_counted_and_stops_nothing(planted: Planted) -> None:
    artifact: Any = probe_root(planted("hostile"))
    usb = next(scan for scan in artifact["scan_methods"] if scan["name"] == "sysfs:usb")
    assert (usb["status"], usb["detail"]) == ("ok", "unreadable: EISDIR 1")


def test_what_a_host_lacks_is_reported_as_not_found(planted: Planted) -> None:
    artifact: Any = probe_root(planted("empty-vm"))
    status = {scan["name"]: scan["status"] for scan in artifact["scan_methods"]}
    assert status["sysfs:usb"] == status["proc:asound"] == status["udev:db"] == "not_found"
    assert status["sysfs:class/tty"] == "ok"


def test_a_folder_without_anything_is_a_valid_host(tmp_path: Path) -> None:
    artifact: Any = probe_root(tmp_path)
    assert artifact["devices"] == []
    assert [error.message for error in Draft202012Validator(SCHEMA).iter_errors(artifact)] == []
