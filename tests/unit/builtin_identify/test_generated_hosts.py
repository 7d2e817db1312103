"""The embedded agent on hosts without a recording: nothing of its own is refused, and what shows is made use of.

`make recordings` takes ten thousand devices; here are a few of each kind.
"""

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from generated_hosts import DEFAULT_SERIALS, REGISTERED, generate, ids, wrong
from generated_kinds import KINDS

from octoform.base.id_databases import IdDatabases


@pytest.mark.parametrize("seed", range(4))
def test_what_is_true_of_a_generated_host_is_told_of_it(seed: int, tmp_path: Path) -> None:
    made = generate(tmp_path / "host", seed, 30)
    assert wrong(tmp_path / "host", made) == []
    generate(tmp_path / "other", seed, 30, order=1)
    assert ids(tmp_path / "other") == ids(tmp_path / "host")


def test_the_number_of_a_chip_behind_its_wire_is_no_product(tmp_path: Path) -> None:
    made = generate(tmp_path / "host", 100_250, 25)
    assert wrong(tmp_path / "host", made) == []


def test_each_kind_and_each_form_of_strings_is_among_them(tmp_path: Path) -> None:
    made = [each for seed in range(20) for each in generate(tmp_path / "host", seed, 30)]
    assert {each.kind for each in made} == set(KINDS)
    forms = Counter(each.strings for each in made)
    assert forms.keys() == {"tell", "nothing", "mislead", "script", "native"} and min(forms.values()) >= 5
    assert sum(each.default_serial for each in made) >= 5 and DEFAULT_SERIALS
    registered = Counter(each.registered for each in made if each.strings != "nothing")
    assert registered.keys() == {"", *REGISTERED} and min(registered.values()) >= 5


def test_the_id_databases_of_a_host_have_the_registered_names(tmp_path: Path) -> None:
    for seed in range(6):
        made = generate(tmp_path / "host", seed, 30)
        assert (tmp_path / "host/usr/share/misc/usb.ids").is_file() == any(each.registered for each in made)
        for each in made:
            found = IdDatabases(tmp_path / "host").lookup(*_numbers(tmp_path / "host/sys/devices" / each.place))[1]
            assert all(hint in found for hint in each.hints), each
            assert bool(found) == (each.registered not in ("", "absent")), each


def _numbers(folder: Path) -> tuple[str, str, str]:
    for bus, *names in (("usb", "idVendor", "idProduct"), ("pci", "vendor", "device")):
        if (folder / names[0]).is_file():
            vendor, product = ((folder / name).read_text().strip().removeprefix("0x") for name in names)
            return bus, vendor, product
    return "", "", ""


def test_a_registered_name_in_place_of_the_device_s_own_is_reported(tmp_path: Path) -> None:
    made = generate(tmp_path / "host", 0, 30)
    own = [each for each in made if each.strings == "tell"]
    lines = wrong(tmp_path / "host", [replace(each, hints=(each.product,)) for each in own])
    assert len(lines) >= len(own) and all("after the id database" in line for line in lines)


def test_an_invariant_that_does_not_hold_is_told(tmp_path: Path) -> None:
    made = generate(tmp_path / "host", 0, 12)
    changed = [replace(each, product="Nobody99", categories=frozenset({"nothing"})) for each in made]
    lines = wrong(tmp_path / "host", changed)
    assert sum("Nobody99" in line for line in lines) == sum("category" in line for line in lines) == 12
