"""The common part of the coding-agent programs: find, configure, run and read one.

An adapter adds what differs: how its program is started and configured, and the dialect of its output. Its
configuration lies in the attempt's own home folder, so nothing of the user's own setup is read or changed.
"""

import shlex
import shutil
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Protocol

from octoform.base import files
from octoform.base.files import read
from octoform.diagnostics import Diagnostic
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.containment import bounded_command
from octoform.harness.llm.route import Access, access, unusable
from octoform.harness.port import ExitReason, Outcome, ProgressSink, Task
from octoform.harness.program_location import Located, Pin, locate
from octoform.manifest.model import HarnessSpec
from octoform.manifest.references import resolve
from octoform.records import dataclass, replace


@dataclass(frozen=True, slots=True)
class Launch:
    """All that an adapter knows of one run: the task, the way to the model, the program, its own new home folder."""

    task: Task
    access: Access
    program: Located
    spec: HarnessSpec

    @property
    def home(self) -> Path:
        """The HOME of the program; exists, empty, and is removed after the run."""
        return self.task.workdir / "home"

    @property
    def key(self) -> str:
        """The API key for programs that take it by a variable of their own; empty where there is none.

        Never write it into a file or an argument: name the variable there.
        """
        return self.task.environment.get(self.access.key or "", "")

    @property
    def prompt(self) -> str:
        """The prompt as an argument, for programs that take no other way."""
        return read(self.task.prompt).decode("utf-8", "replace").replace("\0", "\ufffd")


class Adapter(Protocol):
    """The interface of an adapter module."""

    name: ClassVar[str]
    pin: ClassVar[Pin]
    apis: ClassVar[tuple[str, ...]]

    def invocation(self, launch: Launch) -> Invocation:
        """Write the configuration below ``launch.home`` and say how the program is started and read."""
        ...


@dataclass(frozen=True, slots=True)
class ProgramHarness:
    """The harness of one coding-agent program."""

    adapter: Adapter
    spec: HarnessSpec

    @property
    def name(self) -> str:
        """The name that is in the manifest."""
        return self.adapter.name

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        way = access(self.spec, task.model, self.adapter.apis, task.environment)
        if isinstance(way, Diagnostic):
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, f"{way.summary} ({way.hint})")
        problem = unusable(way.key, task.environment)
        if problem is not None:
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, problem)
        program = self.locate(task.environment)
        if program is None:
            return Outcome(ExitReason.NOT_INSTALLED, None, 0.0, missing(self.adapter))
        (task.workdir / "home").mkdir(mode=0o700, exist_ok=True)
        invocation = self.adapter.invocation(Launch(task, way, program, self.spec))
        return run_contained(task, replace(invocation, sandbox=self.spec.sandbox), progress)

    def locate(self, environ: Mapping[str, str]) -> Located | None:
        """The program that would run."""
        command = tuple(resolve(item, environ) for item in self.spec.command)
        return locate(self.adapter.pin, command, environ)


def missing(adapter: Adapter) -> str:
    """The one line for a program that is nowhere."""
    return f"{adapter.pin.binary} is not installed; `octoform install {adapter.name}` installs {adapter.pin.version}"


# The shell of programs that would wait for whatever a command leaves running: the bounded one, under its own name.
#
# They look for ``bash`` on PATH, so a folder with a script of that name stands first there. What a command itself
# starts finds the real one again.

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
    files.replace(shell, "".join(f"{line}\n" for line in lines).encode(), 0o700, synced=False)
    shell.chmod(0o700)
    return (str(folder), *launch.program.path)
