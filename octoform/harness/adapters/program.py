"""What the coding-agent programs have in common: found, given a way to the model, run, read.

An adapter adds what differs: how its program is started and configured, and the dialect of its output. Its
configuration lies in the attempt's own home folder, so nothing of the user's own setup is read or changed.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Protocol

from octoform.base.files import read
from octoform.diagnostics import Diagnostic
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.install.program_location import Located, Pin, locate
from octoform.harness.llm.route import Access, access, unusable
from octoform.harness.port import ExitReason, Outcome, ProgressSink, Task
from octoform.manifest.model import HarnessSpec
from octoform.manifest.references import resolve


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
    """What an adapter module gives."""

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
        """The name that stands in the manifest."""
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
