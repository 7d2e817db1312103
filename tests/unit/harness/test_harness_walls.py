"""What a sandbox lacks on a kernel without seccomp or Landlock: by values, and by a kernel that refuses the calls."""

import json
import subprocess
import sys
from pathlib import Path

import older_kernel
import pytest

from octoform.harness.containment.sandbox import Kernel, kernel, missing_walls

ASKED = (
    "import json; from octoform.harness.containment.sandbox import kernel; "
    "f = kernel(); print(json.dumps([f.filters, f.landlock]))"
)


def test_a_whole_kernel_lacks_nothing() -> None:
    assert missing_walls(Kernel(True, 6)) == () == missing_walls(Kernel(True, 9))


@pytest.mark.parametrize(
    ("found", "words"),
    [
        (Kernel(False, 6), ["no filter of system calls (seccomp)"]),
        (Kernel(True, 0), ["no Landlock, and scopes begin with version 6"]),
        (Kernel(True, 5), ["version 5 of Landlock, and scopes begin with version 6"]),
        (Kernel(False, 0), ["seccomp", "Landlock"]),
    ],
)
def test_each_wall_that_is_not_there_is_one_line_with_what_it_means(found: Kernel, words: list[str]) -> None:
    lines = missing_walls(found)
    assert len(lines) == len(words)
    assert all(word in line and "the agent may" in line for word, line in zip(words, lines, strict=True))


def test_the_filter_is_there_where_the_kernel_lists_its_actions() -> None:
    assert kernel().filters is Path("/proc/sys/kernel/seccomp/actions_avail").exists()


@pytest.mark.parametrize("without", ["landlock", "seccomp"])
def test_a_kernel_that_refuses_the_calls_has_none(without: str) -> None:
    command = [sys.executable, older_kernel.__file__, without, sys.executable, "-c", ASKED]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    filters, landlock = json.loads(done.stdout)
    whole = kernel()
    assert (filters, landlock) == ((whole.filters, 0) if without == "landlock" else (False, whole.landlock))
