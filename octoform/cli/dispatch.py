"""Parse, run the one command, leave with its exit code.

A command's module is imported only when it is chosen; ``--help`` and a plan with nothing to do import next to nothing.

SIGTERM and SIGHUP are an orderly stop: an exception that unwinds, so that a stopped run leaves what Ctrl-C leaves.
Otherwise these signals end the process where it stands, with its lock, its journal and the agent's private folders.
"""

import gc
import os
import select
import signal
import sys
import threading
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import TextIO

from octoform.cli.parser import RENAMED, UsageError, parse
from octoform.diagnostics import Diagnostic, Severity, error
from octoform.records import replace
from octoform.views.format import console, problems

_READING = frozenset(
    (
        *("attempts", "coverage", "devices", "doctor", "explain", "graph", "health", "incidents"),
        *("logs", "plan", "schema", "show", "status", "validate", "help", "version", "completion"),
    )
)
"""Commands that write nothing into the project; every other one first sees to it that git ignores what is private."""


_HERE = frozenset(("init", "simulate", "schema", "explain", "help", "version", "completion", "connect", "estop"))
"""Commands that need no project, make one, or find theirs by a rule of their own."""
_WITHOUT_FOLDER = frozenset(("schema", "explain", "help", "version", "completion"))
"""Commands that read and write no folder."""
MANIFEST = "octopus.yaml"
_SYSROOT = "OCTOFORM_SYSROOT"
GROUPS = {
    "project": "init validate schema explain graph doctor install profile spec simulate",
    "run": "plan apply destroy answer attempts",
    "state": "show state devices coverage force_unlock",
    "endpoint": "start stop restart logs service connect clients",
    "tools": "tools call look",
    "safety": "token revoke estop audit limits",
    "daemon": "watch status health heal claims confirm pause resume incidents",
    "about": "help version completion",
}
"""The modules of `octoform.cli.commands`, each with its commands; ``run_plan`` carries out ``plan``."""


_LASTING = ("watch",)
_SELDOM = (500_000, 20, 50)
"""Thresholds of a rare garbage collection, which otherwise took a tenth of an apply.

An apply ends with 110 000 objects, of which 4 000 are garbage: it ends before the first collection.
"""
_WITHOUT_PLUGINS = ("PYDANTIC_DISABLE_PLUGINS", "__all__")
"""Keeps pydantic from looking through all installed distributions for plugins, which octoform has no use for."""
STOPS = (signal.SIGTERM, signal.SIGHUP)
UNWINDING_SECONDS = 20.0
"""How long a stop may take before the next signal counts as another one; a closed terminal sends several at once."""


def dispatch(argv: Sequence[str]) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    screen = console.for_process()
    _only_absolute_folders()
    _keep_owner_rights()
    try:
        return _dispatched(argv, screen)
    except BrokenPipeError:
        # The reader of the output is gone; no one is left to inform, and Python must not try again at exit.
        _print_nowhere(sys.stdout)
        return 1
    except OSError as problem:  # what had to be printed, even about a problem, found no room
        return _unprinted(problem, screen)


def _dispatched(argv: Sequence[str], screen: console.Console) -> int:
    try:
        with orderly():
            arguments = parse(argv)
            if arguments.no_color:
                screen = replace(screen, colour=False, colour_err=False)
            if arguments.renamed is not None:
                problems.renamed(screen, arguments.renamed, " ".join(RENAMED[arguments.renamed]))
            if arguments.version:
                return problems.version(screen)
            return _printed(_run(arguments, screen), screen)
    except UsageError as problem:
        return problems.usage(screen, str(problem), problem.usage)
    except Stopped as stopped:
        return problems.stopped(screen, stopped.number)
    except KeyboardInterrupt:
        return problems.interrupted(screen)


def _only_absolute_folders() -> None:
    """A folder in PATH that has no root is one of the project's, where an agent may have left another ``git``."""
    words = os.environ.get("PATH", "").split(os.pathsep)
    absolute = [word for word in words if Path(word).is_absolute()]
    if absolute != words and absolute:
        os.environ["PATH"] = os.pathsep.join(absolute)
    # A home without a root is another one in each folder: files of clients would land in the project, or at the root.
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        if not Path(os.environ.get(name, "/")).is_absolute():
            del os.environ[name]
    if "HOME" not in os.environ and not _has_account():
        os.environ["HOME"] = "/"  # as containers have it for a user id without an account; it is closed to most


def _has_account() -> bool:
    try:
        Path.home()
    except RuntimeError:
        return False
    return True


def _keep_owner_rights() -> None:
    """A umask that takes the owner's own rights makes files and folders that the next step cannot open."""
    others = 0o077
    os.umask(os.umask(others) & others)


def command_of(name: str) -> Callable[[Namespace, Path, console.Console], int]:
    """The function that carries out a command; only its module is loaded."""
    name = name.replace("-", "_")
    group = next(group for group, names in GROUPS.items() if name in names.split())
    found: Callable[[Namespace, Path, console.Console], int]
    found = getattr(import_module(f"octoform.cli.commands.{group}"), f"run_{name}")
    return found


def _run(arguments: Namespace, screen: console.Console) -> int:
    """The command itself; where the operating system refuses it something, it ends with that as a problem."""
    if arguments.command not in _LASTING:
        gc.set_threshold(*_SELDOM)
    os.environ.setdefault(*_WITHOUT_PLUGINS)
    try:
        project = _project(arguments, screen)
        if arguments.command not in _WITHOUT_FOLDER and (problem := _name_problem(project)) is not None:
            return problems.show(screen, [problem], as_json=_as_json(arguments))
        if arguments.command not in _READING:
            _hide(project, screen)
        status = command_of(arguments.command)(arguments, project, screen)
    except BrokenPipeError:
        raise
    except OSError as problem:
        from octoform.state.files import unforeseen_refusal  # only a refusal pays for it

        return problems.show(screen, [unforeseen_refusal(problem)], as_json=_as_json(arguments))
    return status


def _printed(status: int, screen: console.Console) -> int:
    """The exit status once all output is out; 1 where it could not be written, as on a full disk."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as problem:
        return _unprinted(problem, screen, status)
    return status


def _unprinted(problem: OSError, screen: console.Console, status: int = 0) -> int:
    """The exit status of a command whose output found no room: a sentence on stderr, or none where that is full."""
    from octoform.state.files import unforeseen_refusal

    _print_nowhere(sys.stdout)
    try:
        return status or problems.show(screen, [unforeseen_refusal(problem)])
    except OSError:
        _print_nowhere(sys.stderr)
        return 1


def _print_nowhere(stream: TextIO) -> None:
    """Python prints what is left when it ends, and must not be refused once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _project(arguments: Namespace, screen: console.Console) -> Path:
    """The folder to work in: the one that was named, else this one or the nearest above that is a project of ours."""
    given = f"-chdir: {arguments.chdir or '.'}"
    try:
        here = Path(os.path.realpath(arguments.chdir or "."))  # of a link to itself, too
        if not here.is_dir():
            raise UsageError(f"{given} is not a folder", "")
    except FileNotFoundError:
        if arguments.command in _WITHOUT_FOLDER:
            return Path("/")
        raise UsageError("the folder that this shell is in was removed; change to one that is there", "") from None
    except OSError as problem:
        raise UsageError(f"{given}: {problem.strerror}", "") from None
    if arguments.chdir is not None or arguments.command in _HERE:
        return here
    above = next((folder for folder in (here, *here.parents) if _is_project(folder)), here)
    if above != here:
        screen.problem(f"octoform: working in {above}, the nearest folder with {MANIFEST}")
    return above


def _name_problem(project: Path) -> Diagnostic | None:
    """PROJECT-NAME where a folder's name is not UTF-8: tasks and files of clients are JSON, and cannot name it."""
    for what, name in (("the name of the folder", str(project)), (_SYSROOT, os.environ.get(_SYSROOT, ""))):
        try:
            name.encode()
        except UnicodeEncodeError:
            hint = "rename the folder, then run the same command again"
            return error("PROJECT-NAME", f"{what} is not UTF-8", path=name, hint=hint)
    return None


def _is_project(folder: Path) -> bool:
    """Whether its manifest is of this user: in a folder that others write to, somebody else may have put one."""
    try:
        owners = {(folder / MANIFEST).stat().st_uid, folder.stat().st_uid}
    except OSError:  # none, or one that may not be looked at
        return False
    return owners == {os.geteuid()}


def _hide(project: Path, screen: console.Console) -> None:
    """A refusal is only reported: a full disk does not hold up an emergency stop, and a failed write reports itself."""
    from octoform.state.files import hide_from_git

    problem = hide_from_git(project)
    if problem is not None:
        problems.show(screen, [replace(problem, severity=Severity.WARNING)])


def _as_json(arguments: Namespace) -> bool:
    return bool(getattr(arguments, "json", False)) or getattr(arguments, "json_arguments", None) is not None


class Stopped(KeyboardInterrupt):
    """The process was asked to stop by the signal ``number``; whatever lets an interrupt pass lets this pass too."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


@contextmanager
def orderly() -> Iterator[None]:
    """Raise `Stopped` in the block at SIGTERM and SIGHUP; one that is ignored (``nohup``) or handled stays so."""
    here = threading.current_thread() is threading.main_thread()
    taken = [number for number in STOPS if here and signal.getsignal(number) is signal.SIG_DFL]
    handler = _Handler()
    for number in taken:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


class _Handler:
    def __init__(self) -> None:
        self._stopped_at = float("-inf")

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        now = time.monotonic()
        if now - self._stopped_at < UNWINDING_SECONDS:
            return
        self._stopped_at = now
        _part_with_lost_readers()
        raise Stopped(number)


def _part_with_lost_readers() -> None:
    """Where the terminal is gone, or the program behind a pipe, printing fails, and the stop must not end in that."""
    for descriptor in (1, 2):
        looked = select.poll()
        looked.register(descriptor, 0)
        if any(event & (select.POLLERR | select.POLLHUP) for _, event in looked.poll(0)):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, descriptor)
            os.close(nowhere)
