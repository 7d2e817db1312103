"""Run an apply for which the disk is full from the N-th passing of a named durable point on; prints how it ended.

``python disk_filling.py PROJECT TARGET POINT N``. A limit on the size of files stands for the full disk: the system
cuts a write in the middle with EFBIG, everywhere and without any right, as a full disk does with ENOSPC.
"""

import os
import resource
import sys
from pathlib import Path

from octoform.engine.apply.apply import Options, apply
from octoform.engine.plan.plan import Request
from octoform.state.store.store import Ports
from octoform.views.apply import RunHuman
from octoform.views.format.console import Console

ROOM = 200


def main() -> None:
    project, target, point, wanted = Path(sys.argv[1]), sys.argv[2], sys.argv[3], int(sys.argv[4])
    passed: list[str] = []

    def checkpoint(name: str) -> None:
        passed.append(name)
        if passed.count(point) == wanted:
            hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
            resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, hard))

    with Path(os.devnull).open("w") as nowhere:
        screen = Console(nowhere, sys.stderr, colour=False, colour_err=False, interactive=False)
        options = Options(approved=True, ports=Ports(checkpoint=checkpoint))
        result = apply(Request(project, os.environ, targets=(target,)), options, RunHuman(screen))
    sys.stdout.write(f"{result.failed or 'done'} {passed.count(point)}\n")


if __name__ == "__main__":
    main()
