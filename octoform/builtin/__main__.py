"""``python -m octoform.builtin task.json``: run one stage and say in one line how it went.

Each stage's module is imported only when it is asked for: PROBE must not wait for the template engine of SERVE.
Exit status: 0 when the output was written, 1 with one line of reason on stderr otherwise.
"""

import gc
import os
import resource
import sys
from importlib import import_module
from pathlib import Path

from octoform.base.shortage import is_shortage
from octoform.builtin.task import TaskRefused, read_task

USAGE = "usage: python -m octoform.builtin <task.json>"
MAX_MEMORY = 1 << 30
"""Bytes of private memory. The largest recorded host needs a tenth of it; a board with 1 GB must survive a mistake."""


def main(arguments: list[str]) -> int:
    """Run the task named by the only argument; the exit status."""
    if len(arguments) != 1:
        print(USAGE, file=sys.stderr)
        return 1
    try:
        task = read_task(Path(arguments[0]))
        summary = import_module(f"octoform.builtin.{task.stage.partition('.')[0]}").run(task)
    except TaskRefused as reason:
        print(" ".join(str(reason).split()), file=sys.stderr)
        return 1
    except OSError as problem:
        if not is_shortage(problem):
            raise
        print(problem.strerror, file=sys.stderr)
        return 1
    except MemoryError:
        print(f"this stage needs more than {MAX_MEMORY >> 20} MiB of memory", file=sys.stderr)
        return 1
    print(summary)
    return 0


if __name__ == "__main__":
    gc.set_threshold(50_000, 20, 50)  # it ends soon, and walks through trees in which there is no garbage
    resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY, MAX_MEMORY))
    status = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)  # what is loaded need not be taken apart
