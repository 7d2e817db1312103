"""Run the command that was typed: find its row, build its parser, prepare its folder, leave with its exit code.

A command's module is imported only when it is chosen, and what only some commands need is imported where it is used: a
plan with nothing to do imports next to nothing.

SIGTERM and SIGHUP are an orderly stop: an exception that unwinds, so that a stopped run leaves what Ctrl-C leaves.
Otherwise these signals end the process where it stands, with its lock, its journal and the agent's private folders.
"""

from __future__ import annotations

import gc
import os
import select
import signal
import sys
import time
from importlib import import_module
from pathlib import Path

from octoform.cli import table
from octoform.cli.table import HEADING, HERE, HOST, LASTING, NOWHERE, READS, Arguments, Command, UsageError
from octoform.diagnostics import Diagnostic, as_warning, did_you_mean, error
from octoform.views.format import console, problems

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from types import FrameType
    from typing import Protocol, TextIO, TypeVar

    from octoform.state.layout import Layout

    T = TypeVar("T")
    T_contra = TypeVar("T_contra", contravariant=True)

    class View(Protocol[T_contra]):
        """Shows a result to a person or to a program; returns the exit code."""

        def __call__(self, console: console.Console, result: T_contra, /, *, as_json: bool) -> int:
            """Show it."""


MANIFEST = "octopus.yaml"
_SYSROOT = "OCTOFORM_SYSROOT"
_SELDOM = (500_000, 20, 50)
"""Thresholds of a rare garbage collection, which otherwise took a tenth of an apply.

An apply ends with 110 000 objects, of which 4 000 are garbage: it ends before the first collection.
"""
_WITHOUT_PLUGINS = ("PYDANTIC_DISABLE_PLUGINS", "__all__")
"""Keeps pydantic from looking through all installed distributions for plugins, which octoform has no use for."""
STOPS = (signal.SIGTERM, signal.SIGHUP)
UNWINDING_SECONDS = 20.0
"""How long a stop may take before the next signal counts as another one; a closed terminal sends several at once."""


class Run:
    """What a command works with: the project's folder, the environment, the screen and the form of the output."""

    project: Path
    layout: Layout
    """Of the project's host, for a command that the table gives one."""
    ending: str | None = None
    """What a stop means for the work at hand, when not what it means for an apply; empty: it ends silently."""

    def __init__(self, screen: console.Console) -> None:
        self.screen = screen
        self.environ: Mapping[str, str] = os.environ
        self.as_json = False

    @property
    def here(self) -> tuple[Path, Mapping[str, str]]:
        """The project's folder and the environment: what most of the engine starts from."""
        return self.project, self.environ

    def show(self, *found: Diagnostic) -> int:
        """Diagnostics as the outcome, on standard error or as one JSON document; exit code 1 when one is an error."""
        return problems.show(self.screen, found, as_json=self.as_json)

    def note(self, *found: Diagnostic) -> int:
        """Diagnostics beside the outcome, always on standard error; exit code 1 when one is an error."""
        return problems.show(self.screen, found)

    def answer(self, answered: tuple[T | None, Sequence[Diagnostic]], view: View[T], *, noted: bool = False) -> int:
        """Show a result, or the diagnostics where there is none; ``noted``: its diagnostics beside it, too."""
        result, found = answered
        if result is None:
            return self.show(*found)
        if noted:
            self.note(*found)
        return view(self.screen, result, as_json=self.as_json)


def dispatch(argv: Sequence[str]) -> int:
    """Run the command line; the exit codes are those of ``octoform --help``."""
    run = Run(console.for_process())
    _only_absolute_folders()
    _keep_owner_rights()
    try:
        return _dispatched(argv, run)
    except BrokenPipeError:
        # The reader of the output is gone; no one is left to inform, and Python must not try again at exit.
        _print_nowhere(sys.stdout)
        return 1
    except OSError as problem:  # what had to be printed, even about a problem, found no room
        return _unprinted(problem, run)


def _dispatched(argv: Sequence[str], run: Run) -> int:
    try:
        with OrderlyStop():
            return _printed(_understood(Line(argv), run), run)
    except UsageError as problem:
        return problems.usage(run.screen, str(problem), problem.usage)
    except Stopped as stopped:
        return problems.stopped(run.screen, stopped.number, run.ending)
    except KeyboardInterrupt:
        return problems.interrupted(run.screen, run.ending)


class Line:
    """The command line up to the command: the options before it, its row, and the words behind it."""

    command: Command | None = None
    former: str | None = None
    words: Sequence[str] = ()

    def __init__(self, argv: Sequence[str]) -> None:
        """UsageError for an option or a command that does not exist."""
        self.chdir: str | None = None
        self.no_color = False
        self.help = False
        words = list(argv)
        while words and words[0].startswith("-"):
            self._take(words)
        if words:
            self.former = words[0] if words[0] in table.FORMER else None
            self.command, self.words = table.chosen(words)

    def _take(self, words: list[str]) -> None:
        form, equals, value = words.pop(0).partition("=")
        name = form.removeprefix("-").removeprefix("-")
        if name == "chdir":
            if not equals and not words:
                raise UsageError("-chdir: give the folder to work in", table.usage())
            self.chdir = value if equals else words.pop(0)
        elif name == "no-color" and not equals:
            self.no_color = True
        elif name == "version" and not equals:
            words[:] = ["version"]
        elif name in ("h", "help") and not equals:
            self.help = True
            words.clear()
        else:
            near = did_you_mean(name, sorted(table.OPTIONS))
            hint = f"did you mean -{near}?" if near else "octoform --help lists what there is"
            raise UsageError(f"octoform knows no option {form!r}; {hint}", table.usage())

    def arguments(self) -> Arguments:
        """What was typed behind the command; UsageError, or SystemExit(0) once its help was printed."""
        if self.command is None:
            raise SystemExit(0)
        declared = arguments_of(self.command)
        untyped = None if self.words else declared.untyped()
        if untyped is not None:
            return untyped
        from octoform.cli.parser import parsed  # its library takes as long as all else of a small command

        return parsed(self.command, declared, self.words)


def function_of(command: Command) -> Callable[[Arguments, Run], int]:
    """The function that carries out a command; only its module is loaded."""
    module = import_module(f"octoform.cli.commands.{command.group}")
    found: Callable[[Arguments, Run], int] = getattr(module, "run_" + command.name.replace(" ", "_").replace("-", "_"))
    return found


def arguments_of(command: Command) -> type[Arguments]:
    """The class of its arguments: the type of the first parameter of its function."""
    function = function_of(command)
    found: type[Arguments] = function.__globals__[next(iter(function.__annotations__.values()))]
    return found


def _understood(line: Line, run: Run) -> int:
    """Carry out the command of a line, or show the help that it asks for."""
    if line.no_color:
        run.screen = run.screen.uncoloured()
    command = line.command
    if command is None:
        return _show_overview(run.screen, None, 0 if line.help else 1)
    if line.former is not None:
        problems.renamed(run.screen, line.former, command.name)
    if HEADING in command.traits:
        if {"-h", "-help", "--help"} & {*line.words}:
            return _show_overview(run.screen, command, 0)
        raise UsageError(f"octoform {command.name} needs a verb: {', '.join(command.verbs())}", table.usage(command))
    try:
        arguments = line.arguments()
    except SystemExit:  # how argparse ends after its help
        return 0
    if arguments.no_color:
        run.screen = run.screen.uncoloured()
    run.as_json = arguments.as_json
    try:
        return _carry_out(command, arguments, line.chdir, run)
    except UsageError as problem:
        from octoform.cli.parser import Parser

        raise UsageError(str(problem), problem.usage or Parser(command, type(arguments)).format_usage()) from None


def show_help(words: Sequence[str], run: Run) -> int:
    """Print what ``octoform WORDS --help`` prints."""
    return _understood(Line([*words, "--help"]), run)


def _show_overview(screen: console.Console, heading: Command | None, status: int) -> int:
    for text in table.overview(heading):
        screen.line(text)
    return status


def _carry_out(command: Command, arguments: Arguments, chdir: str | None, run: Run) -> int:
    """The command itself; where the operating system refuses it something, it ends with that as a problem."""
    if LASTING not in command.traits:
        gc.set_threshold(*_SELDOM)
    os.environ.setdefault(*_WITHOUT_PLUGINS)
    try:
        run.project = _project(command, chdir, run.screen)
        if NOWHERE not in command.traits and (problem := _name_problem(run.project)) is not None:
            return run.show(problem)
        if not {READS, NOWHERE} & {*command.traits}:
            _hide(run)
        if HOST in command.traits:
            from octoform.engine.tools import layout_of

            layout, found = layout_of(*run.here)
            if layout is None:
                return run.show(*found)
            run.layout = layout
        return function_of(command)(arguments, run)
    except BrokenPipeError:
        raise
    except OSError as problem:
        from octoform.state.files import unforeseen_refusal  # only a refusal pays for it

        return run.show(unforeseen_refusal(problem))


def _only_absolute_folders() -> None:
    """A folder in PATH that has no root is one of the project's, where an agent may have left another ``git``."""
    words = os.environ.get("PATH", "").split(os.pathsep)
    absolute = [word for word in words if word.startswith("/")]
    if absolute != words and absolute:
        os.environ["PATH"] = os.pathsep.join(absolute)
    # A home without a root is another one in each folder: files of clients would land in the project, or at the root.
    for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME"):
        if not os.environ.get(name, "/").startswith("/"):
            del os.environ[name]
    if "HOME" not in os.environ:
        try:
            Path.home()
        except RuntimeError:  # as containers have it for a user id without an account; the root is closed to most
            os.environ["HOME"] = "/"


def _keep_owner_rights() -> None:
    """A umask that takes the owner's own rights makes files and folders that the next step cannot open."""
    others = 0o077
    os.umask(os.umask(others) & others)


def _printed(status: int, run: Run) -> int:
    """The exit status once all output is out; 1 where it could not be written, as on a full disk."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as problem:
        return _unprinted(problem, run, status)
    return status


def _unprinted(problem: OSError, run: Run, status: int = 0) -> int:
    """The exit status of a command whose output found no room: a sentence on stderr, or none where that is full."""
    from octoform.state.files import unforeseen_refusal

    _print_nowhere(sys.stdout)
    try:
        return status or run.note(unforeseen_refusal(problem))
    except OSError:
        _print_nowhere(sys.stderr)
        return 1


def _print_nowhere(stream: TextIO) -> None:
    """Python prints what is left when it ends, and must not be refused once more."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _project(command: Command, chdir: str | None, screen: console.Console) -> Path:
    """The folder to work in: the one that was named, else this one or the nearest above that is a project of ours."""
    given = f"-chdir: {chdir or '.'}"
    try:
        here = Path(os.path.realpath(chdir or "."))  # of a link to itself, too
        if not here.is_dir():
            raise UsageError(f"{given} is not a folder", table.SEE_HELP)
    except FileNotFoundError:
        if NOWHERE in command.traits:
            return Path("/")
        text = "the folder that this shell is in was removed; change to one that is there"
        raise UsageError(text, table.SEE_HELP) from None
    except OSError as problem:
        raise UsageError(f"{given}: {problem.strerror}", table.SEE_HELP) from None
    if chdir is not None or {HERE, NOWHERE} & {*command.traits}:
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


def _hide(run: Run) -> None:
    """A refusal is only reported: a full disk does not hold up an emergency stop, and a failed write reports itself."""
    from octoform.state.files import hide_from_git

    problem = hide_from_git(run.project)
    if problem is not None:
        run.note(as_warning(problem))


class Stopped(KeyboardInterrupt):
    """The process was asked to stop by the signal ``number``; whatever lets an interrupt pass lets this pass too."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


class OrderlyStop:
    """Raise `Stopped` in the block at SIGTERM and SIGHUP; one that is ignored (``nohup``) or handled stays so."""

    def __init__(self) -> None:
        self._taken: list[signal.Signals] = []
        self._stopped_at = float("-inf")

    def __enter__(self) -> None:
        for number in STOPS:
            if signal.getsignal(number) is signal.SIG_DFL:
                try:
                    signal.signal(number, self._stop)
                except ValueError:  # not the main thread, which alone is given signals
                    return
                self._taken.append(number)

    def __exit__(self, *_: object) -> None:
        for number in self._taken:
            signal.signal(number, signal.SIG_DFL)

    def _stop(self, number: int, _frame: FrameType | None) -> None:
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
