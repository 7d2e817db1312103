"""IDENTIFY on recorded hosts and rigs: what is wrong is refused with its cure, what is right is accepted."""

import copy
import json
from typing import Any

import identify_cases
from case_hosts import SCHEMAS, host
from cases import for_each
from identify_cases import RIGHT, WRONG

from octoform.contracts.contract_check import check
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Diagnostic, Severity

HOSTS = ("laptop", "bench", "raspberry", "server", "rail", "rig", "rig bare", "lab", "shop")


def errors(where: str, change: identify_cases.Change) -> list[Diagnostic]:
    known = host(where)
    value: Any = copy.deepcopy(known.identified)
    change(value)
    given = Artifacts(probe=known.probe, profiles=known.profiles, answers=known.answers, registered=known.registered)
    return [item for item in check("identify", value, given, SCHEMAS) if item.severity is Severity.ERROR]


def test_there_are_enough_of_both() -> None:
    assert len(WRONG) >= 100 and len(RIGHT) >= 50
    assert len({code for _, _, code, _ in WRONG.values()}) >= 25


@for_each("where", HOSTS)
def test_what_the_embedded_agent_writes_is_accepted(where: str) -> None:
    assert errors(where, lambda _: None) == []


@for_each("case", WRONG, every=2)
def test_what_the_evidence_does_not_bear_out_is_refused_with_the_cure(case: str) -> None:
    where, change, code, cure = WRONG[case]
    found = errors(where, change)
    lines = [
        json.dumps([item.summary, item.hint, item.detail], ensure_ascii=False) for item in found if item.code == code
    ]
    assert any(cure in text for text in lines), [(item.code, item.summary, item.hint) for item in found]


@for_each("case", RIGHT, every=2)
def test_what_a_person_would_write_is_accepted(case: str) -> None:
    where, change = RIGHT[case]
    found = errors(where, change)
    assert found == [], [(item.code, item.summary, item.hint) for item in found]
