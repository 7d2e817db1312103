"""Small programs in Python that a test puts in the place of real ones, in a folder of any name.

The kernel cuts a ``#!`` line at a blank, so the interpreter of a checkout in such a folder cannot stand in one. A shell
starts it instead, by a line that Python reads as a string; pip and uv do the same.
"""

import shlex
import sys
from pathlib import Path


def head(*options: str) -> str:
    """The first lines of a program that this very interpreter runs with ``options``."""
    words = " ".join(map(shlex.quote, (sys.executable, *options)))
    return f"#!/bin/sh\n'''exec' {words} \"$0\" \"$@\"\n' '''\n"


def python_program(path: Path, code: str, *options: str) -> Path:
    """A program at ``path`` that runs ``code``."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{head(*options)}{code}\n")
    path.chmod(0o755)
    return path
