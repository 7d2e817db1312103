"""Problems outside any command's own output: usage errors, interruption, diagnostics without a view."""

import json
import signal
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import octoform
from octoform.base.escaping import escaped_json
from octoform.diagnostics import Diagnostic, has_errors, to_json
from octoform.views.format.console import Console

GOES_ON = "what was accepted stays accepted, the next apply goes on from there"


def usage(console: Console, message: str, usage_line: str) -> int:
    """A command line that could not be understood; exit code 1."""
    console.problem(f"octoform: {message}")
    console.problem(usage_line.strip() or "see octoform --help")
    return 1


def renamed(console: Console, former: str, name: str) -> None:
    """A command was called by a name that the next version does not know."""
    console.problem(f"octoform: `octoform {former}` is now `octoform {name}`; the next version knows the new name only")


def interrupted(console: Console, text: str = GOES_ON) -> int:
    """Ctrl-C; exit code 130. ``text`` is what that means for the work at hand."""
    console.problem(f"\noctoform: interrupted; {text}")
    return 130


def stopped(console: Console, number: int, text: str = GOES_ON) -> int:
    """Ended by a signal; exit code 128 and its number, as a shell has it."""
    console.problem(f"octoform: stopped by {signal.Signals(number).name}; {text}")
    return 128 + number


def version(console: Console, *, as_json: bool = False) -> int:
    """The version; exit code 0."""
    plain = f"octoform {octoform.__version__}"
    console.raw(json.dumps({"format": 1, "version": octoform.__version__}) if as_json else plain)
    return 0


def near(item: Diagnostic) -> Diagnostic:
    """The diagnostic with its path as a person in this folder would type it."""
    if item.path is None or not Path(item.path).is_absolute() or not Path(item.path).is_relative_to(Path.cwd()):
        return item
    return replace(item, path=str(Path(item.path).relative_to(Path.cwd())))


def show(console: Console, items: Iterable[Diagnostic], *, as_json: bool = False) -> int:
    """Diagnostics to standard error (or one JSON object to standard output); exit code 1 when one is an error."""
    items = [near(item) for item in items]
    if as_json:
        document = {"format": 1, "diagnostics": [to_json(item) for item in items]}
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False)))
    elif items:
        from octoform.views.format.diagnostics import render  # only a problem pays for it

        for item in items:
            console.problem(render(item, colour=console.colour_err, width=console.width_err) + "\n")
    return 1 if has_errors(items) else 0
