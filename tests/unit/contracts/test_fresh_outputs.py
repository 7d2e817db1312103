"""Outputs that were written before the rules were read: what is wrong is refused, what is right accepted."""

import copy
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from typing import Any

import bent_cases as bent
import class_cases as classes
import fresh_cases as fresh
import novel_cases as novel
import outcome_cases as outcome
import pytest
import stray_cases as stray
import unseen_cases as unseen
import wrong_deploys
from bench_host import desk, smallest_first, watched
from case_hosts import SCHEMAS, TOP, host, scan_beside
from cases import for_each
from probe_cases import LINE
from server_edits import Absent, complete

from octoform.builtin.interface import declare
from octoform.contracts.contract_check import RULES, check
from octoform.contracts.model import Artifacts
from octoform.diagnostics import Diagnostic, Severity, has_errors
from octoform.profiles import devices_of, for_task
from octoform.profiles.profile_parser import load

pytestmark = pytest.mark.dear

Found = list[Diagnostic]
Judge = Callable[[Any], Found]


def probed(where: str, change: Any) -> Found:
    value = copy.deepcopy(host(where).probe)
    change(value)
    return check("probe", value, Artifacts(scan=scan_beside(where, value)), SCHEMAS)


def identified(where: str, change: Any) -> Found:
    """The judgement of a change of a host's IDENTIFY; an answer about the serial line may stand behind its name."""
    name, _, answer = where.partition(": ")
    known = host(name)
    value: Any = copy.deepcopy(known.identified)
    change(value)
    answers = {**known.answers, **({LINE: answer} if answer else {})}
    given = Artifacts(probe=known.probe, profiles=known.profiles, answers=answers, registered=known.registered)
    return check("identify", value, given, SCHEMAS)


@cache
def declared(where: str) -> Artifacts:
    """INTERFACE of a host with profiles, or of the bench with its lamp, which an answer describes."""
    name, _, answer = where.partition(": ")
    known = host(name)
    found: Any = copy.deepcopy(known.identified)
    if answer:
        stray.RIGHT_LAMP(found)
    paths = [TOP / "profiles" / f"{each}.md" for each in known.profiles]
    lines = [for_task(each, devices_of(each, known.probe, known.answers)) for each in load(paths)[0]]
    interface = declare(found if not answer else known.identified, 30, lines)
    if answer:
        interface["left_out"] = [each for each in interface["left_out"] if each["id"] != LINE]
        interface["tools"] += copy.deepcopy(stray.LAMP_TOOLS)
    answers = {**known.answers, **({LINE: answer} if answer else {})}
    return Artifacts(
        probe=known.probe,
        identify=found,
        interface=interface,
        profiles=known.profiles,
        answers=answers,
        registered=known.registered,
    )


def served(change: Any, hosts: Sequence[Artifacts], *, whole: bool) -> Found:
    """The judgement of the first server that has what the change is about, or the first rule's that finds an error.

    A pair is a change of the server, and one of INTERFACE.
    """
    edit, declares = change if isinstance(change, tuple) else (change, lambda _: None)
    for known in hosts:
        with suppress(Absent):
            server = complete(edit(known.serve))
            interface = copy.deepcopy(known.interface)
            declares(interface)
            artifacts = replace(known, interface=interface)
            if whole:
                return check("serve", server, artifacts, SCHEMAS)
            each = (rule.check(server, artifacts) for rule in RULES["serve"])
            return next((found for found in each if has_errors(found)), [])
    raise AssertionError("no server has what the change is about")


@pytest.fixture(scope="module")
def judges(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Judge]:
    """What judges an output that a change makes of a right one, for each stage of the desk."""
    folder = tmp_path_factory.mktemp("hosts")
    hosts = smallest_first([made(folder / made.__name__) for made in (watched, desk)], 30)
    known = hosts[-1]

    def interface(case: Any) -> Found:
        where, change = case if isinstance(case, tuple) else ("", case)
        given = declared(where) if where else known
        value = copy.deepcopy(given.interface)
        change(value)
        return check("interface", value, given, SCHEMAS)

    def deploy(change: Any) -> Found:
        value = copy.deepcopy(wrong_deploys.GOOD)
        change(value)
        return check("deploy", value, Artifacts(serve=wrong_deploys.SERVER, python="3.11.7"), SCHEMAS)

    return {
        "interface": interface,
        "serve": lambda change: served(change, hosts, whole=True),
        "refusal": lambda change: served(change, hosts, whole=False),
        "deploy": deploy,
    }


HOSTS = ("probe", "identify")
"""The stages whose cases name a host; the others are of the desk."""


def of_all(kind: str) -> dict[str, tuple[str, Any]]:
    """The cases of each stage, by stage and name."""
    found: dict[str, tuple[str, Any]] = {}
    for stage in ("probe", "identify", "interface", "serve", "deploy"):
        for cases in (fresh, unseen, novel, bent, outcome, classes, stray):
            for name, case in getattr(cases, f"{stage.upper()}_{kind}", {}).items():
                assert f"{stage}: {name}" not in found
                found[f"{stage}: {name}"] = case if stage in HOSTS else ("", case)
    return found


WRONG, RIGHT = of_all("WRONG"), of_all("RIGHT")


def judged(case: str, where: str, change: Any, judges: dict[str, Judge], *, wrong: bool = False) -> Found:
    stage = case.partition(":")[0]
    stage = "refusal" if wrong and stage == "serve" else stage
    found = {"probe": probed, "identify": identified}
    all_found = found[stage](where, change) if stage in found else judges[stage](change)
    return [item for item in all_found if item.severity is Severity.ERROR]


@for_each("case", WRONG, parts=4, every=4)
def test_a_wrong_output_is_refused(case: str, judges: dict[str, Judge]) -> None:
    found = judged(case, *WRONG[case], judges, wrong=True)
    assert found
    assert all(item.hint or item.code.endswith(("-SCHEMA", "STATUS-ERROR")) for item in found)


@for_each("case", RIGHT, parts=2, every=4)
def test_a_right_output_in_unusual_form_is_accepted(case: str, judges: dict[str, Judge]) -> None:
    assert judged(case, *RIGHT[case], judges) == []


def test_each_stage_has_cases_of_both_kinds() -> None:
    for stage in ("probe", "identify", "interface", "serve", "deploy"):
        assert sum(case.startswith(stage) for case in WRONG) >= 24
        assert sum(case.startswith(stage) for case in RIGHT) >= 11
