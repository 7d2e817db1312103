"""One lock for each bus, across threads, processes and tasks."""

import asyncio
import fcntl
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from sysfs_tree import Tree

from octoform import runtime
from octoform.runtime import devices

HOLDER = """
import sys
from octoform import runtime
with runtime.bus(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.readline()
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Locks of this test only; other processes of the test use names of their own."""
    monkeypatch.setattr(devices, "_folder", lambda: tmp_path)
    return tmp_path


def test_threads_take_turns() -> None:
    inside, seen = [], []

    def work() -> None:
        with runtime.bus("line"):
            inside.append(1)
            seen.append(len(inside))
            threading.Event().wait(0.002)
            inside.pop()

    threads = [threading.Thread(target=work) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert seen == [1] * 8


def test_a_held_bus_is_busy_after_the_timeout() -> None:
    with runtime.bus("line"), pytest.raises(runtime.BusBusy, match=f"line was in use .*process {os.getpid()}"):
        runtime.bus("line", timeout=0.05).__enter__()
    with runtime.bus("line", timeout=0.05):
        pass


def test_two_buses_do_not_wait_for_each_other() -> None:
    with runtime.bus("line-a"), runtime.bus("line-b", timeout=0.05):
        pass


def test_an_error_inside_releases_the_bus() -> None:
    with pytest.raises(ValueError), runtime.bus("line"):
        raise ValueError
    with runtime.bus("line", timeout=0.05):
        pass


class Stopped(BaseException):
    """What the launcher raises into a tool's thread, wherever it is."""


def test_a_tool_stopped_while_it_takes_the_bus_leaves_no_lock(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        for place in ("flock", "pwrite"):

            def struck(*given: object, place: str = place) -> None:
                getattr(fcntl if place == "flock" else os, f"real_{place}")(*given)
                raise Stopped

            module = fcntl if place == "flock" else os
            patch.setattr(module, f"real_{place}", getattr(module, place), raising=False)
            patch.setattr(module, place, struck)
            with pytest.raises(Stopped):
                runtime.bus("line").__enter__()
            patch.setattr(module, place, getattr(module, f"real_{place}"))
            with runtime.bus("line", timeout=0.05):
                pass


def test_another_process_holds_the_bus_until_it_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    name = f"test-{os.getpid()}-{id(object())}"
    pipe = subprocess.PIPE
    with subprocess.Popen([sys.executable, "-c", HOLDER, name], stdin=pipe, stdout=pipe, text=True) as other:
        assert other.stdout is not None and other.stdout.readline() == "held\n"
        with pytest.raises(runtime.BusBusy, match=f"process {other.pid}"):
            runtime.bus(name, timeout=0.05).__enter__()
        other.kill()
        other.wait()
        with runtime.bus(name, timeout=5):
            pass
    devices._file(name).unlink()


def test_tasks_of_one_loop_take_turns() -> None:
    order = []

    async def work(number: int) -> None:
        async with runtime.bus("line"):
            order.append(number)
            await asyncio.sleep(0.01)
            order.append(number)

    async def both() -> None:
        await asyncio.gather(work(1), work(2))

    asyncio.run(both())
    assert order in ([1, 1, 2, 2], [2, 2, 1, 1])


def test_a_device_is_locked_by_its_place(tree: Tree) -> None:
    tree.usb("pci0/usb1/1-1", "1f00", "00c1")
    with runtime.device("usb-1f00-00c1").bus() as unit, pytest.raises(runtime.BusBusy):
        runtime.bus(unit, timeout=0.02).__enter__()


def test_a_folder_of_another_user_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.undo()
    monkeypatch.setattr(os, "getuid", lambda: 987654)
    place = Path("/tmp/octoform-987654")
    place.symlink_to(tmp_path)
    try:
        with pytest.raises(PermissionError, match="private folder"):
            devices._folder()
    finally:
        place.unlink()
