"""A function in a process of its own: its result comes back, its end is certain, and nothing of it is left."""

import asyncio
import fcntl
import os
import signal
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from waiting import until

from octoform.endpoint.process.start_stop import KEPT_CHILD, _kept_children
from octoform.runtime import child
from octoform.runtime.devices import bus
from octoform.runtime.faults import DeviceFault


@pytest.fixture(autouse=True)
def restored(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "IDLE", 5.0)


def called(function: Any, idle: float) -> Any:
    """The result from a process that ends after so many seconds without a call."""
    child.IDLE = idle
    return child.call(function)


def is_there(pid: int) -> bool:
    return Path(f"/proc/{pid}").exists()


def process() -> int:
    return os.getpid()


def echo(value: Any) -> Any:
    return value


def test_the_result_comes_from_another_process_which_is_kept_for_the_next_call_and_ends_when_idle() -> None:
    first = called(process, 0.5)
    assert first != os.getpid() and called(process, 0.5) == first
    until(lambda: not is_there(first))
    until(lambda: child._idle[process] == [])
    again = called(process, 0.1)
    assert again != first
    until(lambda: not is_there(again))


@pytest.mark.parametrize(
    "value", [None, True, 3, 2.5, "text", b"\xff\x00" * 300_000, [1, (2, "x")], {"a": [b"", None]}]
)
def test_plain_values_go_and_come_as_they_are(value: Any) -> None:
    assert child.call(echo, value) == value


def test_what_is_no_plain_value_is_refused_by_its_type() -> None:
    with pytest.raises(TypeError, match="object is no plain value"):
        child.call(echo, object())

    def strange() -> object:
        return object()

    with pytest.raises(RuntimeError, match="TypeError: object is no plain value"):
        child.call(strange)


def absent() -> None:
    raise FileNotFoundError(2, "No such file or directory", "/dev/nothing")


def missing() -> None:
    import a_library_of_nobody  # type: ignore[import-not-found]  # noqa: F401


def faulty() -> None:
    raise DeviceFault("usb-1f00-00c1", "it gave no picture")


def other() -> None:
    raise ValueError("seven")


@pytest.mark.parametrize(
    ("function", "kind", "said"),
    [
        (absent, FileNotFoundError, "/dev/nothing"),
        (missing, ModuleNotFoundError, "a_library_of_nobody"),
        (faulty, DeviceFault, "it gave no picture"),
        (other, RuntimeError, "ValueError: seven"),
    ],
)
def test_errors_are_those_of_the_function(function: Any, kind: type[Exception], said: str) -> None:
    with pytest.raises(kind, match=said) as found:
        child.call(function)
    assert type(found.value) is kind


def children() -> set[int]:
    found = Path(f"/proc/self/task/{threading.get_native_id()}/children").read_text().split()
    return set(map(int, found))


def test_a_call_that_takes_too_long_ends_with_its_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child, "TIMEOUT", 0.3)
    before, begun = children(), time.monotonic()
    with pytest.raises(TimeoutError, match=r"longer than 0\.3 s"):
        child.call(time.sleep, 60)
    assert time.monotonic() - begun < 5 and children() <= before


def killed() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def test_a_library_that_crashes_takes_nothing_else_down() -> None:
    with pytest.raises(ConnectionError, match=f"signal {signal.SIGSEGV.value}"):
        child.call(killed)
    assert child.call(echo, 1) == 1


def test_an_interrupted_caller_leaves_no_process() -> None:
    before = children()

    def interrupt(*_: Any) -> None:
        raise KeyboardInterrupt

    kept = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            child.call(time.sleep, 60)
    finally:
        signal.signal(signal.SIGALRM, kept)
    assert children() <= before


def test_it_keeps_no_lock_and_no_file_of_the_process_that_started_it(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with path.open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        pid = called(process, 5.0)
    with path.open("w") as again:
        fcntl.flock(again, fcntl.LOCK_EX | fcntl.LOCK_NB)
    assert is_there(pid)
    with bus("of the test"):
        child.call(echo, 1)
    with bus("of the test", timeout=0.0):
        pass


def test_calls_at_once_have_a_process_each() -> None:
    found: list[int] = []

    def one() -> None:
        found.append(called(late, 0.2))

    threads = [threading.Thread(target=one) for _ in range(3)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert len(set(found)) == 3


def late() -> int:
    time.sleep(0.3)
    return os.getpid()


def test_its_name_tells_who_keeps_it() -> None:
    assert Path(f"/proc/{kept_pid()}/comm").read_text().strip() == child.NAME == KEPT_CHILD
    assert kept_pid() in _kept_children(os.getpid())


def kept_pid() -> int:
    return int(child.call(process))


def test_it_ends_with_the_process_that_started_it() -> None:
    found, tells = os.pipe()
    parent = os.fork()
    if parent == 0:
        os.write(tells, str(called(process, 60.0)).encode())
        os._exit(0)
    os.waitpid(parent, 0)
    pid = int(os.read(found, 20))
    until(lambda: not is_there(pid))


def test_where_the_system_s_libraries_do_not_bear_a_copy_it_is_called_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "pidfd_open")
    assert child.call(process) == os.getpid()


class Ended:
    """A process that ended for want of calls a moment before it was asked."""

    status = 0

    def ask(self, request: bytes, timeout: float) -> bytes:
        raise ConnectionError("it has ended")

    def end(self) -> None:
        """There is nothing left to end."""


def test_a_process_that_ends_as_it_is_asked_is_replaced() -> None:
    child._idle[process] = [Ended()]  # type: ignore[list-item]
    assert called(process, 0.2) != os.getpid()


def test_it_serves_from_within_an_event_loop_s_threads() -> None:
    async def several() -> list[int]:
        return [await asyncio.to_thread(child.call, echo, number) for number in range(3)]

    assert asyncio.run(several()) == [0, 1, 2]
