"""Agents made of small real programs, and ways to wait for what they do without guessing a time."""

import sys
from pathlib import Path

from octoform.base.processes import is_alive
from octoform.harness.containment import orphans

PRELUDE = """
import os, signal, sys, time
def note(name):
    start = open("/proc/self/stat", "rb").read().rpartition(b")")[2].split()[19].decode()
    with open(name + ".part", "w") as stream:
        stream.write(f"{os.getpid()} {start}")
    os.rename(name + ".part", name)
def wait_for(name):
    while not os.path.exists(name):
        time.sleep(0.005)
"""


def python(code: str) -> tuple[str, ...]:
    """An agent: a Python program with ``note(name)`` (writes own id and start time) and ``wait_for(name)``."""
    return (sys.executable, "-I", "-S", "-c", PRELUDE + code)


def noted(path: Path) -> orphans.Process:
    """The process that wrote a note, as a value that stays meaningful after its death."""
    pid, start = path.read_text().split()
    return orphans.Process(int(pid), int(start), 0, "")


def alive(process: orphans.Process) -> bool:
    """True when exactly that process still runs."""
    return is_alive(process.pid, process.start)
