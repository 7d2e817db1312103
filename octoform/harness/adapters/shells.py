"""The shell of programs that would wait for whatever a command leaves running: the bounded one, under its own name.

They look for ``bash`` on PATH, so a folder with a script of that name stands first there. What a command itself starts
finds the real one again.
"""

import shlex
import shutil
import sys
from pathlib import Path

from octoform.base.files import replace
from octoform.harness.adapters.program import Launch
from octoform.harness.containment import bounded_command

COMMAND_SHARE = 0.75
"""How much of the time without a sign of progress a command may use up."""


def command_seconds(idle: float) -> float:
    """How long a command may run until it is asked to end: killed, it is gone well before the run is idle."""
    return max(idle * COMMAND_SHARE - bounded_command.GRACE_SECONDS, idle / 2)


def bounded(launch: Launch) -> tuple[str, ...]:
    """Folders to put before PATH so that each command is bounded; writes the script below ``launch.home``."""
    program = shutil.which("bash", path=launch.task.environment.get("PATH")) or "/bin/sh"
    idle = launch.task.limits.idle_seconds or 0.0
    script = Path(bounded_command.__file__)
    argv = (sys.executable, "-I", "-S", str(script), f"{command_seconds(idle):g}", program)
    folder = launch.home / "shells"
    folder.mkdir()
    shell = folder / "bash"
    # A prefix and no more of PATH is cut off: what the program has put before it stays.
    lines = ("#!/bin/sh", f"PATH=${{PATH#*{shlex.quote(str(folder))}:}}", f'exec {shlex.join(argv)} "$@"')
    replace(shell, "".join(f"{line}\n" for line in lines).encode(), 0o700, synced=False)
    shell.chmod(0o700)
    return (str(folder), *launch.program.path)
