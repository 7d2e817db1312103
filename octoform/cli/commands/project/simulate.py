"""``simulate``: simulated devices in the foreground. They are a program of their own, which takes this one's place."""

import os
import sys
from argparse import Namespace
from pathlib import Path

from octoform.views.format.console import Console


def run(arguments: Namespace, project: Path, _screen: Console) -> int:
    """Does not return; the program leaves with 0 when it was ended, with 1 when it could not begin."""
    command = [sys.executable, "-m", "octoform.simulation", _rig(arguments.rig, project)]
    if arguments.folder is not None:
        command += ["-folder", str(project / arguments.folder)]
    for text in arguments.set:
        command += ["-set", text]
    if arguments.json:
        command.append("-json")
    sys.stdout.flush()
    os.execv(sys.executable, command)


def _rig(rig: str, project: Path) -> str:
    """A project's own ``profiles/rigs/NAME.yaml`` takes the place of a shipped one of that name."""
    own = project / "profiles" / "rigs" / f"{rig}.yaml"
    if own.is_file():
        return str(own)
    return str(project / rig) if rig.endswith(".yaml") else rig
