"""Runs one octoform command in this process and tells what its own process spent, and what its children did, by phase.

``python inside.py REPORT ARGUMENT...``. The share of octoform itself is RUSAGE_SELF of this process, from the start of
the interpreter to the end of the command, together with the supervisors of its agents (a supervisor's share is what the
children of an attempt spent beyond what the supervisor says its agent spent). Everything else is RUSAGE_CHILDREN, set
down to a phase by the lines of the JSON stream: a line is written as one phase ends and the next begins.
"""

import json
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

BEGAN = time.monotonic()


def children() -> float:
    """CPU seconds of all children that were waited for, and theirs."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


class Marks:
    """Standard output for the command: each line of the JSON stream closes one phase and opens another."""

    def __init__(self) -> None:
        self.phases = {"agent": 0.0, "environment": 0.0, "import": 0.0, "server": 0.0, "other": 0.0}
        self.done: dict[str, float] = {}
        self.lines: list[dict[str, Any]] = []
        self._phase = "other"
        self._since = 0.0

    def write(self, text: str) -> int:
        """One line, as the views write them."""
        event = json.loads(text)
        self.lines.append(event)
        self.phases[self._phase] += children() - self._since
        self._since = children()
        self._phase = self._next(event)
        if event["type"] == "apply_complete":
            self.done[event["node"]] = time.monotonic() - BEGAN
        return len(text)

    def _next(self, event: dict[str, Any]) -> str:
        if event["type"] == "attempt_start":
            return "agent"
        what = event.get("what", "")
        words = {"environment": "environment", "importing": "import", "starting": "server"}
        return next((phase for word, phase in words.items() if word in what), "other")

    def flush(self) -> None:
        """Nothing is held back."""

    def isatty(self) -> bool:
        """Nobody looks."""
        return False


def count_agents(spent: list[float]) -> None:
    """Note what each supervisor says that its agent spent."""
    from octoform.harness import attempt

    original: Callable[..., Any] = attempt.run

    def noted(*arguments: Any) -> Any:
        ended = original(*arguments)
        spent.append(ended.cpu_seconds)
        return ended

    attempt.run = noted


def main() -> int:
    """Run the command and write the report."""
    from octoform.cli.main import main as octoform

    report, arguments = Path(sys.argv[1]), sys.argv[2:]
    marks, agents = Marks(), []
    count_agents(agents)
    screen, sys.stdout = sys.stdout, marks
    try:
        status = octoform([*arguments, "-json"])
    finally:
        sys.stdout = screen
    used = resource.getrusage(resource.RUSAGE_SELF)
    supervisors = max(0.0, marks.phases["agent"] - sum(agents))
    document = {
        "own": used.ru_utime + used.ru_stime,
        "supervisors": supervisors,
        "phases": {**marks.phases, "agent": sum(agents)},
        "agents": len(agents),
        "done": marks.done,
        "wall": time.monotonic() - BEGAN,
        "events": marks.lines,
    }
    report.write_text(json.dumps(document))
    return status


if __name__ == "__main__":
    sys.exit(main())
