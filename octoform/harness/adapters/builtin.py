"""Harness ``builtin``: the embedded agent, started as a process of its own like any other agent.

It is named here only as a module to run: nothing of it is imported, and its output passes the same gate.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Diagnostic, error
from octoform.harness.contained_attempt import Invocation, run_contained
from octoform.harness.port import Outcome, ProgressSink, Task
from octoform.manifest.model import HarnessSpec
from octoform.records import dataclass

MODULE = "octoform.builtin"
PACKAGE_TOOL = (
    "UV_",
    "PIP_",
    "SSL_CERT_",
    "HTTP_PROXY",
    "HTTPS_PROXY",
    "NO_PROXY",
    "http_proxy",
    "https_proxy",
    "no_proxy",
)
"""What DEPLOY's package tool needs where packages come through a mirror or a proxy; values are kept out of the log."""


@dataclass(frozen=True, slots=True)
class BuiltinHarness:
    """Runs ``python -m octoform.builtin task.json`` with this interpreter; needs no model and no network."""

    name: str = "builtin"

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        # Isolated: neither the working directory, which the agent writes to, nor the user's site is on its path.
        argv = (sys.executable, "-I", "-m", MODULE, str(task.document))
        named = tuple(name for name in task.environment if name.startswith(PACKAGE_TOOL))
        return run_contained(task, Invocation(argv, named=named), progress)


def create(spec: HarnessSpec, _environ: Mapping[str, str], _folder: Path | None) -> BuiltinHarness | Diagnostic:
    """The harness, or what is wrong with its settings."""
    if spec.command or spec.env:
        return error(
            "HARNESS-BUILTIN-SETTINGS",
            "the embedded agent takes no command and no variables",
            hint="leave them out, or set name: command",
        )
    return BuiltinHarness()
