"""The words of which all commands' options are made.

Options have Terraform's form (``-target NODE``); the same names work with two dashes.
"""

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn, TypeAlias

from octoform.diagnostics import did_you_mean

_FEW = 8
"""So many choices are listed on one line; more are looked up."""
JSON_HELP = "machine-readable output on standard output"


class UsageError(Exception):
    """The command line could not be understood; carries the message and the usage line."""

    def __init__(self, message: str, usage: str) -> None:
        super().__init__(message)
        self.usage = usage


class Parser(argparse.ArgumentParser):
    """Usage errors as exceptions, no abbreviated options, and ``-help`` in the form that all options have."""

    def __init__(self, **given: Any) -> None:
        super().__init__(**given, add_help=False)
        self.add_argument("-h", "-help", "--help", action="help", help="show this help message and exit")

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(message, self.format_usage())

    def _check_value(self, action: argparse.Action, value: str) -> None:
        """One that is not among forty is told with the one that was meant, not with all of them."""
        if action.choices is None or value in action.choices:
            return
        known = [str(name) for name in action.choices]
        kind = "command" if action.dest == "command" else action.dest
        near = did_you_mean(value, known)
        every = f"octoform help lists the {kind}s" if len(known) > _FEW else f"there are {', '.join(known)}"
        hint = f"did you mean {near}?" if near else every
        raise UsageError(f"there is no {kind} {value!r}; {hint}", self.format_usage() if len(known) <= _FEW else "")

    def check_rest(self, rest: Sequence[str]) -> None:
        """UsageError for words that no option or argument took, with the option that was meant."""
        if not rest:
            return
        word = next((each for each in rest if each.startswith("-")), rest[0])
        name = word.lstrip("-").partition("=")[0]
        near = did_you_mean(name, sorted({known.lstrip("-") for known in self._option_string_actions}))
        kind = "option" if word.startswith("-") else "word"
        said = f"did you mean -{near}?" if near and kind == "option" else f"{self.prog} --help lists what there is"
        raise UsageError(f"{self.prog} knows no {kind} {word!r}; {said}", self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` says."""
        return []


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add(commands: Commands, name: str, text: str, *, json: bool = True) -> Parser:
    """A command with its one line of help; ``json`` gives it ``-json``."""
    command: Parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    # The command's own default would undo a -no-color that stands before it.
    shown = {"action": "store_true", "dest": "no_color", "default": argparse.SUPPRESS, "help": "no colour"}
    command.add_argument("-no-color", "--no-color", **shown)  # type: ignore[arg-type]
    command.set_defaults(parser=command)
    if json:
        flag(command, "json", JSON_HELP)
    return command


def verbs_of(command: Parser) -> Commands:
    """The verbs of a command that does nothing without one."""
    return command.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=Parser)


def flag(command: "argparse._ActionsContainer", name: str, text: str) -> None:
    """An option without a value."""
    command.add_argument(f"-{name}", f"--{name}", action="store_true", help=text)


def value(command: Parser, name: str, metavar: str, text: str, *, default: str | None = None) -> None:
    """An option with a value."""
    command.add_argument(f"-{name}", f"--{name}", metavar=metavar, help=text, default=default)
