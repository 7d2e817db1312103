"""A sample of the fault campaign on live processes; `make faults` runs all of it, several times."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign.bench import Bench
from campaign.injecting import injected
from campaign.making import made
from campaign.model import Case
from campaign.run import CASES

pytestmark = pytest.mark.dear

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


def test_every_case_is_there_once_and_says_what_is_right() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    for case in CASES:
        assert case.kinds or case.ends == "quiet", case.name
        assert case.mend or case.ends != "waits", case.name
