"""A second PROBE gives every specimen the id that it had."""

from typing import Any

import pytest

from octoform.contracts.host_identity import Kept, judged, keep_ids

BASE = "usb-1f00-00c1"


def probe(*specimens: tuple[str, str, str], text: str = "a board") -> dict[str, Any]:
    """An artifact of boards, each (id, port, serial number), as PROBE counts them."""
    devices = []
    for name, port, serial in specimens:
        instance = {"sysfs": f"/sys/devices/usb1/{port}", "port": port, "strength": "positional"}
        instance |= {"serial": serial, "strength": "strong"} if serial else {}
        devices.append({"id": name, "name": "Board", "interface": "usb", "raw_descriptor": text, "instance": instance})
    return {"devices": devices}


def again(new: dict[str, Any], old: dict[str, Any]) -> Kept:
    return keep_ids(new, new, old, {device["id"]: device["instance"] for device in old["devices"]})


def ports(kept: Kept) -> dict[str, str]:
    return {device["id"]: device["instance"]["port"] for device in kept.probe["devices"]}


def test_specimens_that_swapped_ports_keep_their_ids_by_number() -> None:
    old = probe((BASE, "1-2", "A5"), (f"{BASE}-2", "1-3", "B7"))
    kept = again(probe((BASE, "1-2", "B7"), (f"{BASE}-2", "1-3", "A5")), old)
    assert ports(kept) == {BASE: "1-3", f"{BASE}-2": "1-2"}
    assert [device["id"] for device in kept.probe["devices"]] == [BASE, f"{BASE}-2"]
    assert kept.notices == []


def test_one_that_moved_behind_its_twin_keeps_its_id() -> None:
    old = probe((BASE, "1-2", ""), (f"{BASE}-2", "1-3", ""))
    kept = again(probe((BASE, "1-3", ""), (f"{BASE}-2", "1-5", "")), old)
    assert ports(kept) == {BASE: "1-5", f"{BASE}-2": "1-3"}
    assert kept.notices == []


def test_the_second_stays_the_second_when_the_first_is_gone_and_a_new_one_fills_the_gap() -> None:
    old = probe((BASE, "1-2", ""), (f"{BASE}-2", "1-3", ""))
    gone = again(probe((BASE, "1-3", "")), old)
    assert ports(gone) == {f"{BASE}-2": "1-3"}
    back = again(probe((BASE, "1-2", ""), (f"{BASE}-2", "1-3", "")), gone.probe)
    assert ports(back) == {BASE: "1-2", f"{BASE}-2": "1-3"}


def test_a_new_one_does_not_push_the_others_on() -> None:
    old = probe((BASE, "1-2", "A5"), (f"{BASE}-2", "1-3", "B7"))
    kept = again(probe((BASE, "1-1", "C9"), (f"{BASE}-2", "1-2", "A5"), (f"{BASE}-3", "1-3", "B7")), old)
    assert ports(kept) == {BASE: "1-2", f"{BASE}-2": "1-3", f"{BASE}-3": "1-1"}


def test_twins_that_both_moved_are_counted_anew_and_that_is_said() -> None:
    old = probe((BASE, "1-2", ""), (f"{BASE}-2", "1-3", ""))
    kept = again(probe((BASE, "1-4", ""), (f"{BASE}-2", "1-5", "")), old)
    assert ports(kept) == {BASE: "1-4", f"{BASE}-2": "1-5"}
    assert len(kept.notices) == 1
    assert f"{BASE}, {BASE}-2" in kept.notices[0]


def test_another_text_in_the_same_port_is_another_device() -> None:
    old = probe((BASE, "1-2", ""), (f"{BASE}-2", "1-3", ""), text="an arm")
    kept = again(probe((BASE, "1-3", ""), text="a printer"), old)
    assert ports(kept) == {BASE: "1-3"}
    assert kept.notices


def test_one_of_a_kind_is_left_as_it_is() -> None:
    old = probe((BASE, "1-2", "A5"))
    new = probe((BASE, "1-9", "C9"))
    assert again(new, old).probe == new


@pytest.mark.parametrize(("serial", "strength"), [("0001", "positional"), ("A10KZP4X", "strong")])
def test_no_agent_can_call_a_default_number_strong(serial: str, strength: str) -> None:
    instance = {"port": "1-2", "serial": serial, "strength": "strong"}
    probe = {"devices": [{"id": "usb-1f00-00c1", "name": "board", "instance": instance}]}
    assert judged(probe)["devices"][0]["instance"]["strength"] == strength


def test_a_number_that_two_of_a_kind_share_is_strong_for_neither() -> None:
    twins = [
        {"id": name, "name": "board", "instance": {"port": port, "serial": "A10KZP4X", "strength": "strong"}}
        for name, port in (("usb-1f00-00c1", "1-2"), ("usb-1f00-00c1-2", "1-3"))
    ]
    assert [each["instance"]["strength"] for each in judged({"devices": twins})["devices"]] == ["positional"] * 2
