"""SIGTERM and SIGHUP: heard only while the command line runs, once a stop, and never where another hears them."""

import os
import signal
import subprocess
import sys
import threading

import pytest

from octoform.cli import dispatch
from octoform.cli.dispatch import OrderlyStop, Stopped


def raised(number: int) -> None:
    """Send it to this process; its handler runs before this returns."""
    signal.raise_signal(number)


@pytest.mark.parametrize("number", dispatch.STOPS)
def test_a_signal_becomes_an_exception_with_its_number(number: int) -> None:
    with pytest.raises(Stopped) as stopped, OrderlyStop():
        raised(number)
    assert stopped.value.number == number
    assert isinstance(stopped.value, KeyboardInterrupt), "what lets Ctrl-C pass has to let this pass"


def test_nothing_stays_installed_and_nothing_is_at_import() -> None:
    code = "import signal, octoform.cli.dispatch; print([signal.getsignal(n) is signal.SIG_DFL for n in (15, 1)])"
    command = [sys.executable, "-c", code]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[True, True]\n"
    with OrderlyStop():
        assert signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL
    assert [signal.getsignal(number) for number in dispatch.STOPS] == [signal.SIG_DFL] * 2


def test_a_second_signal_does_not_disturb_the_stop_that_is_under_way() -> None:
    unwound = False
    with pytest.raises(Stopped) as stopped, OrderlyStop():
        try:
            raised(signal.SIGHUP)
        finally:
            raised(signal.SIGHUP)
            raised(signal.SIGTERM)
            unwound = True
    assert unwound
    assert stopped.value.number == signal.SIGHUP


def test_a_stop_that_came_to_nothing_can_be_asked_for_again(monkeypatch: pytest.MonkeyPatch) -> None:
    with OrderlyStop():
        with pytest.raises(Stopped):
            raised(signal.SIGTERM)
        raised(signal.SIGTERM)
        monkeypatch.setattr(dispatch, "UNWINDING_SECONDS", 0.0)
        with pytest.raises(Stopped):
            raised(signal.SIGTERM)


def test_what_is_ignored_or_handled_already_stays_so() -> None:
    heard: list[int] = []
    former = {number: signal.getsignal(number) for number in dispatch.STOPS}
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda number, _: heard.append(number))
    try:
        with OrderlyStop():
            raised(signal.SIGHUP)
            raised(signal.SIGTERM)
        assert heard == [signal.SIGTERM]
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        for number, handler in former.items():
            signal.signal(number, handler)


def test_another_thread_may_run_a_command_too() -> None:
    ran: list[int] = []

    def run() -> None:
        with OrderlyStop():
            ran.append(os.getpid())

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert ran == [os.getpid()]
