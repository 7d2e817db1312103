"""A lock ends with its holder, however that ends, and is of the file that has its name now."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from waiting import until

from octoform.base import locks

HOLDS = """
import sys, time
from pathlib import Path
from octoform.base import locks
with locks.held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "a.lock"


@pytest.fixture
def holder(path: Path) -> Iterator[subprocess.Popen[bytes]]:
    with subprocess.Popen([sys.executable, "-c", HOLDS, path], stdout=subprocess.PIPE) as child:
        assert child.stdout is not None and child.stdout.readline() == b"held\n"
        yield child
        child.kill()


def test_another_process_keeps_it_until_it_is_killed(path: Path, holder: subprocess.Popen[bytes]) -> None:
    assert locks.is_locked(path)
    with locks.held(path, 0.0) as mine, locks.held(path, 0.02) as later:
        assert (mine, later) == (False, False)
    holder.send_signal(signal.SIGSTOP)
    assert locks.is_locked(path), "one that stands still keeps it"
    holder.kill()
    with locks.held(path) as mine:
        assert mine and locks.is_locked(path)
    assert not locks.is_locked(path)


def test_who_waits_gets_it_when_it_is_given_back(path: Path) -> None:
    had = threading.Event()

    def wait() -> None:
        with locks.held(path, 30.0) as mine:
            if mine:
                had.set()

    with locks.held(path):
        waiting = threading.Thread(target=wait)
        waiting.start()
        assert not had.is_set()
    waiting.join(30.0)
    assert had.is_set()


def test_the_wait_is_that_of_the_clock_that_was_given(path: Path) -> None:
    """A virtual clock: seven looks in so many pauses, and one that jumps ahead ends the wait at once."""
    pauses: list[float] = []
    with locks.held(path):
        descriptor = locks.lock_file(path)
        try:
            assert not locks.acquire(descriptor, 0.03, clock=lambda: sum(pauses), sleep=pauses.append)
            assert 6 <= len(pauses) <= 7
            leaps = iter([0.0, 3600.0])
            assert not locks.acquire(
                descriptor, 5.0, clock=lambda: next(leaps), sleep=lambda _: pytest.fail("it waits")
            )
        finally:
            os.close(descriptor)


def test_a_program_that_was_started_does_not_keep_it(path: Path) -> None:
    with locks.held(path):
        command = [sys.executable, "-c", "print(flush=True); input()"]
        child = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, close_fds=False)
    assert child.stdout is not None
    try:
        child.stdout.readline()  # it has become the program, which closes what is not its own
        assert not locks.is_locked(path)
    finally:
        child.communicate(b"\n")


def test_a_forked_child_shares_it_and_frees_it_with_its_end(path: Path) -> None:
    first, second = os.pipe()
    with locks.held(path):
        if (child := os.fork()) == 0:
            os.close(second)
            os.read(first, 1)  # until the parent lets it go
            os._exit(0)
    os.close(first)
    assert locks.is_locked(path), "the open file is the child's too"
    os.close(second)
    os.waitpid(child, 0)
    assert not locks.is_locked(path)


def test_readers_share_it_and_shut_a_writer_out(path: Path) -> None:
    with locks.held(path, shared=True), locks.held(path, 0.0, shared=True) as both:
        assert both
        with locks.held(path, 0.0) as mine:
            assert not mine


def test_a_file_that_was_replaced_meanwhile_is_not_the_one_that_is_had(path: Path) -> None:
    with locks.held(path):
        found: list[bool] = []

        def wait() -> None:
            with locks.held(path) as mine:
                found.append(mine and locks.is_locked(path))

        waiting = threading.Thread(target=wait)
        waiting.start()
        place = f":{path.stat().st_ino} "
        result = Path("/proc/locks").read_text
        until(lambda: any("->" in line and place in line for line in result().splitlines()), "it waits")
        path.unlink()
        path.write_bytes(b"")
    waiting.join(30.0)
    assert found == [True], "the lock is that of the file of this name"


@pytest.mark.parametrize("trap", ["link", "folder"])
def test_what_is_no_file_is_no_lock(path: Path, trap: str) -> None:
    if trap == "link":
        path.symlink_to(path.with_name("elsewhere"))
    else:
        path.mkdir()
    with pytest.raises(OSError), locks.held(path):
        pytest.fail("it was had")
    assert not path.with_name("elsewhere").exists()
    if trap == "link":
        with pytest.raises(OSError):
            locks.is_locked(path)


def test_a_lock_that_is_given_back_is_free_while_its_file_stays_open(path: Path) -> None:
    descriptor = locks.lock_file(path)
    try:
        assert locks.acquire(descriptor) and locks.is_locked(path)
        assert locks.acquire(descriptor), "who has it has it"
        locks.release(descriptor)
        assert not locks.is_locked(path)
    finally:
        os.close(descriptor)
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_folder_is_held_itself(tmp_path: Path) -> None:
    with locks.held_folder(tmp_path):
        descriptor = os.open(tmp_path, os.O_RDONLY | os.O_DIRECTORY)
        try:
            assert not locks.acquire(descriptor)
        finally:
            os.close(descriptor)
    (tmp_path / "link").symlink_to(tmp_path)
    with pytest.raises(OSError), locks.held_folder(tmp_path / "link"):
        pytest.fail("a link was followed")
