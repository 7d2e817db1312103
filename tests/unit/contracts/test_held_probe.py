"""PROBE of other agents against the host's own scan: what is wrong is refused with its cure, what is right is not."""

import copy
import json
from typing import Any

import probe_cases
from case_hosts import SCHEMAS, host
from cases import for_each
from probe_cases import RIGHT, WRONG

from octoform.builtin.scan import beside
from octoform.contracts.checking import check, has_shape
from octoform.contracts.model import Artifacts, HostScan
from octoform.contracts.probe_host_rules import completed
from octoform.diagnostics import Diagnostic, Severity

HOSTS = ("laptop", "bench", "raspberry", "server", "rail", "rig", "shop")


def scanned(where: str, value: Any) -> HostScan | None:
    """What the embedded agent saw beside it; None where the output has not even the shape."""
    if not has_shape("probe", value, SCHEMAS):
        return None
    seen = beside(value, host(where).root)
    return HostScan(seen["probe"], tuple(seen["unsaid"]), tuple(seen["untrue"]))


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
    told = [
        json.dumps([item.summary, item.hint, item.detail], ensure_ascii=False) for item in found if item.code == code
    ]
    assert any(cure in text for text in told), [(item.code, item.summary, item.hint) for item in found]


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
