"""PROBE of other agents against the host's own scan: what is wrong is refused with its cure, what is right is not."""

import copy
import json
from pathlib import Path
from typing import Any

import probe_cases
import pytest
from case_hosts import SCHEMAS, host, scan_beside
from cases import for_each
from hosts.plant import plant
from probe_cases import RIGHT, WRONG

from octoform.builtin.probe import probe_root
from octoform.builtin.scan import beside
from octoform.contracts.contract_check import check, has_shape
from octoform.contracts.model import Artifacts, HostScan
from octoform.contracts.rules.probe_host_rules import completed
from octoform.diagnostics import Diagnostic, Severity

HOSTS = ("laptop", "bench", "raspberry", "server", "rail", "rig", "shop")


def scanned(where: str, value: Any) -> HostScan | None:
    """What the embedded agent saw beside it; None where the output has not even the shape."""
    if not has_shape("probe", value, SCHEMAS):
        return None
    return scan_beside(where, value)


def errors(where: str, value: Any) -> list[Diagnostic]:
    found = check("probe", value, Artifacts(scan=scanned(where, value)), SCHEMAS)
    return [item for item in found if item.severity is Severity.ERROR]


def changed(where: str, change: probe_cases.Change) -> Any:
    value = copy.deepcopy(host(where).probe)
    change(value)
    return value


def test_there_are_enough_of_both() -> None:
    assert len(WRONG) >= 60 and len(RIGHT) >= 25
    assert len({code for _, _, code, _ in WRONG.values()}) >= 15


@for_each("where", HOSTS)
def test_what_the_embedded_agent_writes_is_accepted_from_any_agent(where: str) -> None:
    assert errors(where, copy.deepcopy(host(where).probe)) == []


@for_each("case", WRONG)
def test_what_the_host_contradicts_is_refused_with_the_cure(case: str) -> None:
    where, change, code, cure = WRONG[case]
    found = errors(where, changed(where, change))
    lines = [
        json.dumps([item.summary, item.hint, item.detail], ensure_ascii=False) for item in found if item.code == code
    ]
    assert any(cure in text for text in lines), [(item.code, item.summary, item.hint) for item in found]


@for_each("case", RIGHT)
def test_what_an_honest_agent_may_write_is_accepted(case: str) -> None:
    where, change = RIGHT[case]
    found = errors(where, changed(where, change))
    assert found == [], [(item.code, item.summary, item.hint) for item in found]


def test_numbers_drivers_and_spellings_that_were_left_out_are_the_hosts_own() -> None:
    value = changed("laptop", probe_cases.only_kinds)
    value["platform"] |= {"os": "Linux", "arch": "amd64"}
    value["timestamp"] = "2019-04-01T12:00:00Z"
    scan = scanned("laptop", value)
    assert scan is not None
    whole = completed(value, scan)
    (camera,) = [each for each in whole["devices"] if each["id"] == probe_cases.KESTREL]
    assert (camera["vid"], camera["pid"], "uvcvideo" in camera["drivers"]) == ("1d9c", "0c14", True)
    assert (whole["platform"]["os"], whole["platform"]["arch"]) == ("linux", "x86_64")
    assert whole["timestamp"] == scan.probe["timestamp"]


SOUND_RECORD = """udev +sound:card0
  ID_MODEL_FROM_DATABASE=Marsh High Definition Audio Controller
  ID_SERIAL_SHORT=HIDDEN77
class:sound /devices/pci0000:00/0000:00:1f.3/sound/card0
"""
TERMINALS = "group:tty /devices/virtual/tty/tty{0..63}"


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The laptop with 300 terminals and udev's record of the sound card, which is a part of the sound function."""
    card = SOUND_RECORD.splitlines()[-1] + "\n"
    changes = {card: SOUND_RECORD, TERMINALS: TERMINALS.replace("63", "299")}
    return plant("laptop", tmp_path_factory.mktemp("many"), changes)


@for_each("case", ("number: 300", "count: 256", "255 tty", "number: 301", "number: 5000"))
def test_how_many_an_entry_stands_for_is_a_number_up_to_that_of_the_host(many: Path, case: str) -> None:
    value = copy.deepcopy(probe_root(many))
    entry = next(each for each in value["devices"] if each["id"] == "virtual-tty")
    entry["raw_descriptor"] += f"\n{case}"
    found = [item["words"] for item in beside(value, many)["unsaid"]]
    assert found == {"number: 301": [["301"]], "number: 5000": [["5000"]]}.get(case, [])


def test_the_names_that_udev_has_for_a_part_are_names_of_the_device(many: Path) -> None:
    value = copy.deepcopy(probe_root(many))
    entry = next(each for each in value["devices"] if each["id"] == probe_cases.SOUND)
    entry["raw_descriptor"] += "\nmodel from database: Marsh High Definition Audio Controller"
    assert beside(value, many)["unsaid"] == []
    entry["raw_descriptor"] += "\nlabel: HIDDEN77"
    assert [item["words"] for item in beside(value, many)["unsaid"]] == [["hidden77"]]
    other = next(each for each in value["devices"] if each["id"] == probe_cases.WIFI)
    other["raw_descriptor"] += "\nmodel: Marsh High Definition Audio Controller"
    assert probe_cases.WIFI in {item["id"] for item in beside(value, many)["unsaid"]}
