"""Parse, run the one command, leave with its exit code.

A command's module is imported only when it is chosen; ``--help`` and a plan with nothing to do import next to nothing.
"""

import os
import sys
from argparse import Namespace
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path

from octoform.cli.options import UsageError
from octoform.cli.parser import parse
from octoform.cli.stopping import Stopped, orderly
from octoform.views import console, problems


def dispatch(argv: Sequence[str]) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    screen = console.for_process()
    try:
        with orderly():
            arguments = parse(argv)
            if arguments.version:
                return problems.version(screen)
            return _run(arguments, screen)
    except UsageError as problem:
        return problems.usage(screen, str(problem), problem.usage)
    except Stopped as stopped:
        return problems.stopped(screen, stopped.number)
    except KeyboardInterrupt:
        return problems.interrupted(screen)
    except BrokenPipeError:
        # Whoever read the output is gone; there is nobody left to tell, and Python must not try again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1


def _run(arguments: Namespace, screen: console.Console) -> int:
    """The command itself; where the operating system refuses it something, it ends with that as a problem."""
    try:
        project = Path(arguments.chdir).resolve()
        if not project.is_dir():
            raise UsageError(f"-chdir: {arguments.chdir} is not a folder", "")
        command = import_module(f"octoform.cli.commands.{arguments.command.replace('-', '_')}")
        status: int = command.run(arguments, project, screen)
    except BrokenPipeError:
        raise
    except OSError as problem:
        from octoform.state.refusals import refusal  # only a refusal pays for it

        return problems.show(screen, [refusal(problem)], as_json=_as_json(arguments))
    return status


def _as_json(arguments: Namespace) -> bool:
    return bool(getattr(arguments, "json", False)) or getattr(arguments, "json_arguments", None) is not None
