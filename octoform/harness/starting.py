"""Ask an agent program for its version: the cheapest proof that it is there, whole, and starts."""

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from octoform.harness import environment
from octoform.harness.installed import Located
from octoform.harness.shortrun import short_run

SECONDS = 60.0
REASON_CHARS = 300
_VERSION = re.compile(r"\d+\.\d+(?:\.\d+)?[0-9A-Za-z.+-]*")


@dataclass(frozen=True, slots=True)
class Stated:
    """What a program said of itself: its version, or why there is none."""

    version: str | None
    problem: str = ""


def stated_version(located: Located, environ: Mapping[str, str]) -> Stated:
    """The version that ``--version`` prints, started as an agent would be: minimal environment, empty home folder."""
    with TemporaryDirectory(prefix="octoform-home-") as name:
        variables = environment.minimal(Path(name), environ)
        variables["PATH"] = os.pathsep.join((*located.path, variables["PATH"]))
        done = short_run((*located.argv, "--version"), variables, SECONDS)
    if not done.ok:
        said = " ".join((done.stderr or done.stdout).split())
        return Stated(None, f"{done.ending}{f': {said[-REASON_CHARS:]}' if said else ''}")
    found = _VERSION.search(done.stdout)
    return Stated(found.group()) if found else Stated(None, "said no version")
