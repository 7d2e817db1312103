"""Harness ``builtin``: the embedded agent, started as a process of its own like any other agent.

It is named here only as a module to run: nothing of it is imported, and its output passes the same gate.
"""

import sys
from dataclasses import dataclass

from octoform.harness.attempt import Invocation, run_contained
from octoform.harness.port import Outcome, ProgressSink, Task

MODULE = "octoform.builtin"


@dataclass(frozen=True, slots=True)
class BuiltinHarness:
    """Runs ``python -m octoform.builtin task.json`` with this interpreter; needs no model and no network."""

    name: str = "builtin"

    def run(self, task: Task, progress: ProgressSink) -> Outcome:
        """See `Harness.run`."""
        # Isolated: neither the working directory, which the agent writes to, nor the user's site is on its path.
        argv = (sys.executable, "-I", "-m", MODULE, str(task.document))
        return run_contained(task, Invocation(argv), progress)
