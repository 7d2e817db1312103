"""Servers by the dozen: each wrong one is refused for what is wrong, and no right one is, in whatever words."""

from typing import Any

import pytest
from bench_host import desk
from cases import for_each
from guarded_servers import GUARDED, RIGHT
from right_servers import READS, RESULTS, reading, result
from server_edits import all_of, swap
from wrong_servers import BY_DEFINITION, WRONG

from octoform.base.id_databases import IdDatabases
from octoform.builtin.identify import identify
from octoform.builtin.interface import declare
from octoform.builtin.probe.stage import probe_root
from octoform.builtin.serve.stage import render
from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.diagnostics import Severity

LIBRARIES = swap('"opencv-python-headless>=4.10"', '"opencv-python-headless>=4.10", "minimalmodbus", "smbus2"')


@pytest.fixture(scope="module")
def desk_server(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], str]:
    """INTERFACE of the desk, and the server that the embedded agent writes for it."""
    host = desk(tmp_path_factory.mktemp("desk") / "host")
    interface = declare(identify(probe_root(host), IdDatabases(host)), 1000)
    return interface, render(interface)


def errors(text: str, interface: dict[str, Any]) -> set[str]:
    return {item.code for item in serve_static(text, interface) if item.severity is Severity.ERROR}


EVERY = WRONG | {f"guarded: {name}": case for name, case in GUARDED.items()}


@for_each("case", EVERY)
def test_a_wrong_server_is_refused_for_what_is_wrong(case: str, desk_server: tuple[dict[str, Any], str]) -> None:
    interface, good = desk_server
    edit, code = EVERY[case]
    found = errors(edit(good), interface)
    assert code in found and found <= {code, "SERVE-BUS-UNLOCKED", "SERVE-SETS-NOTHING"}


@for_each("way", READS)
def test_a_right_way_to_read_gives_no_finding(way: str, desk_server: tuple[dict[str, Any], str]) -> None:
    interface, good = desk_server
    assert serve_static(all_of(reading(way), LIBRARIES)(good), interface) == []


@for_each("way", RESULTS)
def test_a_right_result_gives_no_finding(way: str, desk_server: tuple[dict[str, Any], str]) -> None:
    interface, good = desk_server
    assert serve_static(result(way)(good), interface) == []


@for_each("way", BY_DEFINITION)
def test_what_an_empty_series_gives_by_definition_is_no_finding(
    way: str, desk_server: tuple[dict[str, Any], str]
) -> None:
    interface, good = desk_server
    assert "SERVE-DEFAULT-READING" not in errors(BY_DEFINITION[way](good), interface)


@for_each("way", RIGHT)
def test_a_number_that_a_test_may_choose_gives_no_finding(way: str, desk_server: tuple[dict[str, Any], str]) -> None:
    interface, good = desk_server
    assert serve_static(RIGHT[way](good), interface) == []


def test_there_are_enough_of_them_to_mean_something() -> None:
    assert len(WRONG) >= 140 and len(READS) + len(RESULTS) >= 70
