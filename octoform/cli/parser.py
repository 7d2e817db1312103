"""The parser of one command, built from what its class declares; only the chosen command has one.

Options have Terraform's form (``-target NODE``, ``-auto-approve``); the same names work with two dashes. Usage errors
leave with status 1, because 2 is an answer: "changes" in ``plan -detailed-exitcode``, "nothing to be seen" in ``look``.
"""

import argparse
import os
from collections.abc import Callable, Sequence
from typing import Any, NoReturn, TypeVar

from octoform.cli.table import Argument, Arguments, Command, UsageError, verbs_of
from octoform.diagnostics import did_you_mean

T = TypeVar("T")


class Parser(argparse.ArgumentParser):
    """The parser of a command: usage errors as exceptions, no abbreviations, ``-help`` in the form of all options."""

    def __init__(self, command: Command, arguments: type[Arguments]) -> None:
        below = "\n".join(verbs_of(command)) or arguments.epilog
        form = argparse.RawDescriptionHelpFormatter if below else argparse.HelpFormatter
        super().__init__(
            prog=f"octoform {command.name}",
            description=command.help,
            epilog=below or None,
            formatter_class=lambda prog: form(prog, width=_columns() - 2),
            add_help=False,
        )
        self._more = arguments.more
        self.add_argument("-h", "-help", "--help", action="help", help="show this help message and exit")
        group = self.add_mutually_exclusive_group() if arguments.exclusive else self
        for name, each in arguments.declared():
            place = group if name in arguments.exclusive else self
            place.add_argument(*each.names(name), **self._given(name, each))

    def _given(self, attribute: str, declared: Argument) -> dict[str, Any]:
        """What argparse is given for an argument."""
        given, kind = dict(declared.given), declared.kind
        if declared.forms is not None:
            given["dest"] = attribute
        if kind is not None:
            name = given["metavar"] if declared.forms is None else declared.names(attribute)[0]
            given["type"] = lambda text: self._converted(name, kind, text)
        return given

    def _converted(self, name: str, kind: Callable[[str], T], text: str) -> T:
        try:
            return kind(text)
        except ValueError as problem:
            raise UsageError(f"{name}: {problem}", self.format_usage()) from None

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(message, self.format_usage())

    def _check_value(self, action: argparse.Action, value: str) -> None:
        """One that is no choice is reported with the one that was meant, where one is near."""
        if action.choices is None or value in action.choices:
            return
        known = [str(name) for name in action.choices]
        near = did_you_mean(value, known)
        hint = f"did you mean {near}?" if near else f"there are {', '.join(known)}"
        raise UsageError(f"there is no {action.dest} {value!r}; {hint}", self.format_usage())

    def check_rest(self, rest: Sequence[str]) -> None:
        """UsageError for words that no option or argument took, with the option that was meant."""
        if not rest:
            return
        word = next((each for each in rest if each.startswith("-")), rest[0])
        name = word.lstrip("-").partition("=")[0]
        near = did_you_mean(name, sorted({known.lstrip("-") for known in self._option_string_actions}))
        kind = "option" if word.startswith("-") else "word"
        text = f"did you mean -{near}?" if near and kind == "option" else f"{self.prog} --help lists what there is"
        if kind == "word" and "=" in word and "-arg" in self._option_string_actions:
            text = f"an argument of a tool is written -arg {word}"
        elif kind == "option" and name in ("v", "verbose") and self._more:
            text = f"{self._more} shows more"
        raise UsageError(f"{self.prog} knows no {kind} {word!r}; {text}", self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` states."""
        return []


def _columns() -> int:
    """How wide the terminal is; the library asks a module that loads five compressions."""
    given = os.environ.get("COLUMNS", "")
    try:
        return (int(given) if given.isdecimal() else os.get_terminal_size(1).columns) or 80
    except OSError:
        return 80


def parsed(command: Command, arguments: type[Arguments], words: Sequence[str]) -> Arguments:
    """What was typed behind a command; UsageError, or SystemExit(0) once its help was printed."""
    parser = Parser(command, arguments)
    found, rest = parser.parse_known_args(list(words))
    parser.check_rest(rest)
    return arguments(**vars(found))
