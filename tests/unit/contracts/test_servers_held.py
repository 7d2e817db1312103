"""Servers by the dozen: each wrong one is refused for what is wrong, and no right one is, in whatever words."""

import copy
from contextlib import suppress
from typing import Any

import novel_servers
import outcome_cases
import pytest
from bench_host import desk, smallest_first, watched
from cases import for_each
from guarded_servers import GUARDED, RIGHT
from right_servers import READS, RESULTS, reading, result
from server_edits import Absent, Edit, all_of, body, complete, requires
from wrong_servers import BY_DEFINITION, WRONG

from octoform.contracts.rules.serve.serve_rules import serve_static
from octoform.diagnostics import Diagnostic, Severity

pytestmark = pytest.mark.dear

LIBRARIES = requires("minimalmodbus", "smbus2")


Servers = list[tuple[dict[str, Any], str]]


@pytest.fixture(scope="module")
def servers(tmp_path_factory: pytest.TempPathFactory) -> Servers:
    """INTERFACE and the server that the embedded agent writes for it, of each class of devices and of each host.

    The last but one is of a thermometer and a camera, the last of a desk.
    """
    roots = [host(tmp_path_factory.mktemp("bench") / "host") for host in (watched, desk)]
    made = smallest_first(roots, 1000)
    return [(known.interface, known.serve) for known in made if known.interface and known.serve]


def judged(edit: Edit, servers: Servers) -> list[Diagnostic]:
    """What is found after the edit of the first server that has what it is about."""
    for interface, good in servers:
        with suppress(Absent):
            return serve_static(complete(edit(good)), interface)
    raise AssertionError("no server has what the edit is about")


def errors(edit: Edit, servers: Servers) -> set[str]:
    return {item.code for item in judged(edit, servers) if item.severity is Severity.ERROR}


def findings(edit: Edit, servers: Servers) -> list[Diagnostic]:
    """The same but for cameras that the server itself opens, a matter of its memory alone."""
    return [item for item in judged(edit, servers) if item.code != "SERVE-CAMERA-IN-SERVER"]


EVERY = WRONG | {f"guarded: {name}": case for name, case in GUARDED.items()}


@for_each("case", EVERY, parts=2, every=4, kind=lambda case: EVERY[case][1])
def test_a_wrong_server_is_refused_for_what_is_wrong(case: str, servers: Servers) -> None:
    edit, code = EVERY[case]
    found = errors(edit, servers)
    assert code in found and found <= {code, "SERVE-BUS-UNLOCKED", "SERVE-SETS-NOTHING"}


@for_each("way", READS, every=3)
def test_a_right_way_to_read_gives_no_finding(way: str, servers: Servers) -> None:
    assert judged(all_of(reading(way), LIBRARIES), servers) == []


@for_each("way", RESULTS, every=3)
def test_a_right_result_gives_no_finding(way: str, servers: Servers) -> None:
    assert findings(result(way), servers) == []


@for_each("way", BY_DEFINITION)
def test_what_an_empty_series_gives_by_definition_is_no_finding(way: str, servers: Servers) -> None:
    assert "SERVE-DEFAULT-READING" not in errors(BY_DEFINITION[way], servers)


@for_each("way", RIGHT)
def test_a_number_that_a_test_may_choose_gives_no_finding(way: str, servers: Servers) -> None:
    assert findings(RIGHT[way], servers) == []


def test_there_are_enough_of_them_to_mean_something() -> None:
    assert len(WRONG) >= 140 and len(READS) + len(RESULTS) >= 70


def test_a_reading_may_end_at_a_bound_that_interface_declares(servers: Servers) -> None:
    cut = novel_servers.WRONG["altered: cut off above"]
    interface, good = copy.deepcopy(servers[-2])
    [tool] = [item for item in interface["tools"] if item["name"] == "read_temperature"]
    value = tool["output_schema"]["properties"]["readings"]["items"]["properties"]["value"]
    assert {item.code for item in serve_static(cut(good), interface)} == {"SERVE-CONSTANT-READING"}
    value["maximum"] = 50
    assert serve_static(cut(good), interface) == []


DECLARED = {
    "bent: at most half": {"maximum": 50},
    "bent: at least a tenth": {"minimum": 10},
    "bent: on both sides": {"minimum": 20, "maximum": 80},
    "bent: in steps of ten": {"multipleOf": 10},
    "bent: rounded to tens": {"multipleOf": 10},
}


@for_each("case", DECLARED)
def test_an_argument_may_end_where_interface_declares_it(case: str, servers: Servers) -> None:
    bent = outcome_cases.SERVE_WRONG[case]
    interface, good = copy.deepcopy(servers[-1])
    assert {item.code for item in serve_static(bent(good), interface)} == {"SERVE-SETS-OTHERWISE"}
    [tool] = [item for item in interface["tools"] if item["name"] == "set_brightness"]
    tool["input_schema"]["properties"]["percent"].update(DECLARED[case])
    assert serve_static(bent(good), interface) == []


def test_a_reading_may_have_the_steps_that_interface_declares(servers: Servers) -> None:
    interface, good = copy.deepcopy(servers[-2])
    coarse = outcome_cases.SERVE_WRONG["coarse: to tens"](good)
    assert {item.code for item in serve_static(coarse, interface)} == {"SERVE-READING-COARSE"}
    [tool] = [item for item in interface["tools"] if item["name"] == "read_temperature"]
    tool["output_schema"]["properties"]["readings"]["items"]["properties"]["value"]["multipleOf"] = 10
    assert serve_static(coarse, interface) == []


def test_a_choice_of_nothing_ends_no_judgement(servers: Servers) -> None:
    interface, good = copy.deepcopy(servers[-1])
    [tool] = [item for item in interface["tools"] if item["name"] == "set_brightness"]
    tool["input_schema"]["properties"]["mode"] = {"type": "string", "enum": []}
    tool["input_schema"]["required"].append("mode")
    assert {item.code for item in serve_static(good, interface)} <= {"SERVE-SCHEMA-DIFFERS"}


MANY_WAYS = """
folder = runtime.device(device).path("video4linux")
level = 0
for name in ("index", "minor", "major", "rate"):
    level += int((folder / name).read_text())
for name in ("dev", "power", "device", "subsystem"):
    if (folder / name).is_dir():
        level += 1
return [{"pixel_format": "YUYV", "width": level, "height": level, "frames_per_second": [30.0]}]
"""


def test_a_reading_in_many_ways_takes_nothing_from_the_others(servers: Servers) -> None:
    interface, good = servers[-2]
    coarse = all_of(body("list_camera_formats", MANY_WAYS), outcome_cases.SERVE_WRONG["coarse: to tens"])
    assert "SERVE-READING-COARSE" in {item.code for item in serve_static(coarse(good), interface)}
