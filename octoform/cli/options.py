"""The words of which all commands' options are made.

Options have Terraform's form (``-target NODE``); the same names work with two dashes.
"""

import argparse
from typing import NoReturn, TypeAlias

JSON_HELP = "machine-readable output on standard output"


class UsageError(Exception):
    """The command line could not be understood; carries the message and the usage line."""

    def __init__(self, message: str, usage: str) -> None:
        super().__init__(message)
        self.usage = usage


class Parser(argparse.ArgumentParser):
    """Usage errors as exceptions, and no abbreviated options."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(message, self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` says."""
        return []


Commands: TypeAlias = "argparse._SubParsersAction[Parser]"


def add(commands: Commands, name: str, text: str, *, json: bool = True) -> Parser:
    """A command with its one line of help; ``json`` gives it ``-json``."""
    command: Parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    if json:
        flag(command, "json", JSON_HELP)
    return command


def verbs_of(command: Parser) -> Commands:
    """The verbs of a command that does nothing without one."""
    return command.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=Parser)


def flag(command: Parser, name: str, text: str) -> None:
    """An option without a value."""
    command.add_argument(f"-{name}", f"--{name}", action="store_true", help=text)


def value(command: Parser, name: str, metavar: str, text: str, *, default: str | None = None) -> None:
    """An option with a value."""
    command.add_argument(f"-{name}", f"--{name}", metavar=metavar, help=text, default=default)
