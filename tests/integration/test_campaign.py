"""A sample of the fault campaign on live processes; `make faults` runs all of it, several times."""

import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign.bench import Bench
from campaign.injecting import injected
from campaign.making import made
from campaign.model import Case
from campaign.run import CASES

pytestmark = pytest.mark.dear

TOP = Path(__file__).parents[2]
KNOWN = (
    *(
        "F12a",
        "F12b",
        "F12c",
        "F12d",
        "F13",
        "F14",
        "F14b",
        "F14c",
        "F14d",
        "F15",
        "F16",
        "F20a",
        "F20b",
        "F21a",
        "F21b",
    ),
    *("F22", "F28", "F30", "F31", "F33", "F34", "F38", "F39"),
)
"""Rows of the list of known faults that concern a deployment which is kept alive."""
PATIENT = 6.0
"""How much longer than on a quiet machine things may take beside all other tests."""
SAMPLE = (
    "server.py cut in half",
    "killed",
    "camera moved at once",
)
"""The camera last: the next fault would hit a daemon that is just noticing that it is back."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Iterator[Bench]:
    """One deployment with its daemon for all of them."""
    found = made("scripted", tmp_path_factory.mktemp("campaign"), environments)
    found.forgets = False
    yield found
    found.close()
    assert found.strangers() == []


@pytest.mark.parametrize("name", SAMPLE)
def test_a_fault_is_noticed_and_repaired_and_nothing_else_is_touched(bench: Bench, name: str) -> None:
    case = next(case for case in CASES if case.name == name)
    patient = Case(**{**vars(case), "detect": case.detect * PATIENT, "repair": case.repair * PATIENT, "hold": 0.5})
    result = injected(patient, bench)
    assert (result.missed, result.wrong, result.calls, result.survivors) == ([], [], 0, 0), bench.said()


def test_every_known_fault_is_shown_by_something_that_is_there() -> None:
    page = (TOP / "docs" / "faults.md").read_text().split("## What shows each known fault")[1].split("\n## ")[0]
    rows = {cells[1].strip(): cells[3] for cells in (line.split("|") for line in page.splitlines()) if len(cells) == 5}
    assert set(KNOWN) <= set(rows)
    names = {case.name for case in CASES}
    for row, shown in list(rows.items())[2:]:
        cases, tests = re.findall(r'"([^"]+)"', shown), re.findall(r"`([^`]+)::([^`]+)`", shown)
        assert cases or tests, row
        assert set(cases) <= names, row
        for path, name in tests:
            assert f"def {name}(" in (TOP / "tests" / path).read_text(), name


def test_every_case_is_there_once_and_says_what_is_right() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kinds or case.ends == "quiet", case.name
        assert case.mend or case.ends != "waits", case.name
