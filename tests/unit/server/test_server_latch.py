"""The latch: there or not, whatever stands in it, seen by every process at once."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from octoform.server import latch as module
from octoform.server.latch import Estop, Latch

ROOT = str(Path(module.__file__).parents[3])


@pytest.fixture
def latch(tmp_path: Path) -> Latch:
    return Latch(tmp_path / "run/estop.json")


def test_open_latched_and_open_again(latch: Latch) -> None:
    assert latch.engaged() is None
    estop = latch.engage("ada", "smoke")
    assert (estop.by, estop.reason, latch.engaged(), Latch(latch.path).engaged()) == ("ada", "smoke", estop, estop)
    assert latch.engage("bob", "more smoke") == estop  # the first one stays
    latch.keep()
    assert latch.clear("eve") == estop
    assert (latch.engaged(), latch.clear("eve")) == (None, None)
    assert latch.path.parent.stat().st_mode & 0o777 == 0o700
    assert [path.name for path in latch.path.parent.iterdir()] == []


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b'{"by":1}', b"\xff" * 100_000, b"[" * 100_000], ids=len)
def test_what_cannot_be_read_is_latched(latch: Latch, content: bytes) -> None:
    latch.path.parent.mkdir()
    latch.path.write_bytes(content)
    found = latch.engaged()
    assert found is not None and "cannot be read" in found.reason
    assert latch.clear("eve") == found
    assert latch.engaged() is None


def test_whatever_stands_there_is_latched(latch: Latch) -> None:
    latch.path.mkdir(parents=True)
    assert latch.engaged() is not None
    latch.path.rmdir()
    latch.path.symlink_to("nowhere")
    assert latch.engaged() is not None
    latch.path.unlink()
    os.mkfifo(latch.path)
    assert latch.engaged() is not None


def test_a_place_that_cannot_be_looked_at_is_latched(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("a file")
    found = Latch(tmp_path / "run/estop.json").engaged()
    assert found is not None and "cannot be looked at" in found.reason


def test_without_a_file_it_holds_in_this_process(tmp_path: Path) -> None:
    (tmp_path / "run").symlink_to("nowhere")
    latch = Latch(tmp_path / "run/estop.json")
    with pytest.raises(OSError):
        latch.engage("ada", "smoke")
    found = latch.engaged()
    assert found is not None and found.by == "ada"


def test_a_latch_of_another_process_is_seen_at_once(latch: Latch) -> None:
    program = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1])\n"
        "from octoform.server.latch import Latch\n"
        "latch = Latch(Path(sys.argv[2]))\n"
        "for line in sys.stdin:\n"
        "    print(latch.engage('other', line) if line.strip() else latch.clear('other'), flush=True)"
    )
    command = [sys.executable, "-c", program, ROOT, str(latch.path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdin is not None and other.stdout is not None
        for number in range(20):
            other.stdin.write(f"{number}\n")
            other.stdin.flush()
            other.stdout.readline()
            found = latch.engaged()
            assert found is not None and found.reason == f"{number}\n"
            other.stdin.write("\n")
            other.stdin.flush()
            other.stdout.readline()
            assert latch.engaged() is None
        other.stdin.close()


def test_asking_is_cheap(latch: Latch) -> None:
    for estop in (None, "there"):
        if estop:
            latch.engage("ada", "smoke")
        best = min(_spent(latch) for _ in range(20))
        assert best < 20e-6  # measured: 2 microseconds; the bound leaves room for a busy machine


def _spent(latch: Latch) -> float:
    begun = time.process_time()
    for _ in range(500):
        latch.engaged()
    return (time.process_time() - begun) / 500


def test_one_at_a_time_holds_it(latch: Latch) -> None:
    with latch.held(0) as first, latch.held(0) as second:
        assert (first, second) == (True, False)
    with latch.held(0) as third:
        assert third


def test_long_words_are_cut_and_strange_ones_pass(latch: Latch) -> None:
    estop = latch.engage("a" * 9000, "\ud800\x00\u202e\n" * 100)
    assert isinstance(estop, Estop)
    assert (len(estop.by), estop.reason) == (500, ("\ud800\x00\u202e\n" * 100)[:500])
    assert latch.path.stat().st_size < 5000
