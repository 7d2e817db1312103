"""Whether an endpoint answers, in virtual time: a hung one is reported soon, what is slow or ending is not."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from octoform.daemon.observe.process import Answering, wants_to_run
from octoform.endpoint.process.record import Running
from octoform.state.layout import Layout

PROCESS = Running(1, 1, (), "one", "now", "local", None)
OTHER = Running(2, 2, (), "two", "now", "local", None)
TOLD = {"pid": 1}


class Endpoint:
    """An endpoint that answers as a test wants, and takes its time for it."""

    def __init__(self) -> None:
        self.now = 0.0
        self.told: Mapping[str, Any] | None = TOLD
        self.takes, self.greets, self.runs = 0.0, True, False
        self.asked = self.greeted = 0
        self.answering = Answering(Layout(Path("/nowhere"), "bench"), lambda: self.now)
        self.answering.ask, self.answering.greeted = self._ask, self._greet
        self.answering.busy = lambda _: self.runs

    def _ask(self, _: Layout, seconds: float) -> Mapping[str, Any] | None:
        self.asked += 1
        self.now += min(self.takes, seconds)
        return self.told if self.takes <= seconds else None

    def _greet(self, _: Layout, seconds: float) -> bool:
        self.greeted += 1
        return self.greets

    def after(self, seconds: float) -> bool | None:
        """The answer at the next ping."""
        self.now += seconds
        return self.answering(PROCESS)[0]


@pytest.fixture
def endpoint() -> Endpoint:
    return Endpoint()


def test_one_that_answers_is_greeted_seldom(endpoint: Endpoint) -> None:
    assert endpoint.answering(PROCESS) == (True, TOLD)
    assert [endpoint.after(3.0) for _ in range(20)] == [True] * 20
    assert (endpoint.asked, endpoint.greeted) == (21, 5)


def test_one_that_stands_still_is_told_in_ten_seconds_with_the_time_until_the_ping(endpoint: Endpoint) -> None:
    endpoint.takes = 1000.0
    assert endpoint.answering(PROCESS) == (False, None)
    assert endpoint.now + 3.0 < 10.0


def test_one_slow_answer_is_none(endpoint: Endpoint) -> None:
    endpoint.takes = 2.9
    assert endpoint.after(3.0) is True


def test_one_that_gets_no_processor_has_more_time_but_not_for_ever(endpoint: Endpoint) -> None:
    endpoint.takes, endpoint.runs = 1000.0, True
    assert [endpoint.after(3.0) for _ in range(2)] == [None, False]
    assert endpoint.now < 20.0


def test_one_that_is_ending_has_closed_its_door_and_is_not_hung(endpoint: Endpoint) -> None:
    endpoint.told = None
    assert [endpoint.after(3.0) for _ in range(5)] == [None] * 5
    assert endpoint.after(3.0) is False


def test_an_error_at_the_door_is_no_answer(endpoint: Endpoint) -> None:
    endpoint.told = {"error": "too many questions are being answered"}
    assert endpoint.after(3.0) is None


def test_an_event_loop_that_is_busy_for_moments_is_not_hung(endpoint: Endpoint) -> None:
    endpoint.greets = False
    assert [endpoint.after(3.0) for _ in range(3)] == [True] * 3
    endpoint.greets = True
    assert endpoint.after(3.0) is True
    endpoint.greets = False
    assert [endpoint.after(3.0) for _ in range(6)] == [True] * 6  # from its next turn on
    assert not all(endpoint.after(3.0) for _ in range(6))


def test_what_was_shut_is_forgotten_with_the_process(endpoint: Endpoint) -> None:
    endpoint.told = None
    for _ in range(5):
        endpoint.after(3.0)
    endpoint.now += 3.0
    assert endpoint.answering(OTHER) == (None, None)


def test_a_process_that_runs_is_told_from_one_that_waits() -> None:
    assert wants_to_run(os.getpid())
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(write)
        os.read(read, 1)
        os._exit(0)
    while wants_to_run(child):
        pass
    os.close(write)
    os.waitpid(child, 0)
    assert not wants_to_run(child)
    os.close(read)
