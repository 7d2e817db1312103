"""Run an apply whose process kills itself (SIGKILL) at the N-th checkpoint; prints the name of the point first.

``python crashing.py PROJECT TARGET N``. With N = 0 it runs to the end and prints the points that it passed.
"""

import os
import signal
import sys
from pathlib import Path

from octoform.engine.apply.apply import Options, apply
from octoform.engine.plan.plan import Request
from octoform.state.store.store import Ports
from octoform.views.apply import RunHuman
from octoform.views.format.console import Console


def main() -> None:
    project, target, limit = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
    passed: list[str] = []

    def checkpoint(name: str) -> None:
        passed.append(name)
        if len(passed) == limit:
            print(f"killed at {name}", file=sys.__stdout__, flush=True)
            os.kill(os.getpid(), signal.SIGKILL)

    with Path(os.devnull).open("w") as nowhere:
        screen = Console(nowhere, sys.stderr, colour=False, colour_err=False, interactive=False)
        options = Options(approved=True, ports=Ports(checkpoint=checkpoint))
        result = apply(Request(project, os.environ, targets=(target,)), options, RunHuman(screen))
    if result.failed:
        sys.exit(str(result.failed))
    print(*passed)


if __name__ == "__main__":
    main()
