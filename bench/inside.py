"""Runs one octoform command in this process and tells what its own process spent, and what each of its children did.

``python inside.py REPORT ARGUMENT...``. The share of octoform itself is RUSAGE_SELF of this process, from the start of
the interpreter to the end of the command, together with the supervisors of its agents: what a supervisor's process
tree spent beyond what the supervisor says its agent spent. Every other child is reaped by wait4, which tells what
exactly that child and its own children spent, and is set down to a phase by the program it runs; so work that goes on
beside the agents is told apart from them.
"""

import os
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import Any

BEGAN = time.monotonic()
PROGRAMS = (
    ("import reaper", "supervised"),
    ("/uv", "environment"),
    ("fork_server.py", "server"),
)


class Children:
    """Every child process: what it runs, and what it spent. Takes the place of os.waitpid, which subprocess calls."""

    def __init__(self) -> None:
        self.spent = dict.fromkeys((*(phase for _, phase in PROGRAMS), "other"), 0.0)
        self.agents: list[float] = []
        self._programs: dict[int, str] = {}

    def waitpid(self, pid: int, options: int) -> tuple[int, int]:
        """As os.waitpid, and note what the child spent once it has ended."""
        found, status, used = os.wait4(pid, options)
        if found:
            self.spent[self._programs.pop(found, "other")] += used.ru_utime + used.ru_stime
        return found, status

    def started(self, pid: int, command: Sequence[str]) -> None:
        """Note what a child runs."""
        text = " ".join(str(word) for word in command)
        self._programs[pid] = next((phase for program, phase in PROGRAMS if program in text), "other")

    def watch(self) -> None:
        """From now on; to be called before anything is started."""
        children, waitpid = self, self.waitpid
        start, poll = subprocess.Popen.__init__, subprocess.Popen._internal_poll

        def noted(process: Any, args: Any, *rest: Any, **options: Any) -> None:
            start(process, args, *rest, **options)
            children.started(process.pid, args)

        def polled(process: Any, *rest: Any, **options: Any) -> Any:
            return poll(process, *rest, **{**options, "_waitpid": waitpid})

        os.waitpid = waitpid
        subprocess.Popen.__init__ = noted
        subprocess.Popen._internal_poll = polled
        self._count_agents()

    def _count_agents(self) -> None:
        """Note what each supervisor says that its agent spent."""
        from octoform.harness import contained_attempt

        original = contained_attempt.run

        def noted(*arguments: Any) -> Any:
            ended = original(*arguments)
            self.agents.append(ended.cpu_seconds)
            return ended

        contained_attempt.run = noted


class Lines:
    """Standard output for the command: the lines of the JSON stream, each with its wall time."""

    def __init__(self) -> None:
        self.kept: list[tuple[float, str]] = []

    def write(self, text: str) -> int:
        """One line, as the views write them."""
        self.kept.append((time.monotonic() - BEGAN, text))
        return len(text)

    def flush(self) -> None:
        """Nothing is held back."""

    def isatty(self) -> bool:
        """Nobody looks."""
        return False


def main() -> int:
    """Run the command and write the report."""
    from octoform.cli.main import main as octoform
    from octoform.endpoint.bounded_program import ForkServer

    children, lines = Children(), Lines()
    children.watch()
    screen, sys.stdout = sys.stdout, lines
    try:
        status = octoform([*sys.argv[2:], "-json"])
    finally:
        sys.stdout = screen
    used = resource.getrusage(resource.RUSAGE_SELF)
    ForkServer.end_all()  # it tells what it and its forks spent when it ends
    _write(sys.argv[1], used.ru_utime + used.ru_stime, children, lines)
    return status


def _write(path: str, own: float, children: Children, lines: Lines) -> None:
    import json
    from pathlib import Path

    events = [(wall, json.loads(text)) for wall, text in lines.kept]
    agents = sum(children.agents)
    document = {
        "own": own,
        "supervisors": max(0.0, children.spent.pop("supervised") - agents),
        "phases": {"agent": agents, **children.spent},
        "agents": len(children.agents),
        "done": {event["node"]: wall for wall, event in events if event["type"] == "apply_complete"},
        "wall": time.monotonic() - BEGAN,
        "events": [event for _, event in events],
    }
    Path(path).write_text(json.dumps(document))


if __name__ == "__main__":
    sys.exit(main())
