"""What can be typed: commands, options and their help.

Options have Terraform's form (``-target NODE``, ``-auto-approve``); the same names work with two dashes. Usage errors
leave with status 1, because 2 means "changes" in ``plan -detailed-exitcode``.
"""

import argparse
import re
from collections.abc import Sequence
from typing import NoReturn

EXIT_CODES = """\
exit codes:
  0    done; for `plan -detailed-exitcode`: no changes
  1    an error; the reason is on standard error
  2    only for `plan -detailed-exitcode`: there are changes
  129  stopped by SIGHUP: its terminal was closed
  130  interrupted from the keyboard
  143  stopped by SIGTERM
"""


class UsageError(Exception):
    """The command line could not be understood; carries the message and the usage line."""

    def __init__(self, message: str, usage: str) -> None:
        super().__init__(message)
        self.usage = usage


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise UsageError(message, self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` says."""
        return []


def build() -> argparse.ArgumentParser:
    """The parser of all commands; cheap enough to be built for ``--help`` on a small board."""
    parser = _Parser(
        prog="octoform",
        description="Infrastructure as Code for the hardware of a host.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("-chdir", "--chdir", metavar="DIR", default=".", help="work in DIR, the folder of octopus.yaml")
    parser.add_argument("-version", "--version", action="store_true", help="print the version and leave")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands", parser_class=_Parser)
    _reading(commands)
    _working(commands)
    _state(commands)
    _endpoint(commands)
    _agents(commands)
    return parser


def _add(commands: "argparse._SubParsersAction[_Parser]", name: str, text: str, *, json: bool = True) -> _Parser:
    command: _Parser = commands.add_parser(name, help=text, description=text, allow_abbrev=False)
    if json:
        command.add_argument("-json", "--json", action="store_true", help=_JSON)
    return command


_JSON = "machine-readable output on standard output"


def _flag(command: _Parser, name: str, text: str) -> None:
    command.add_argument(f"-{name}", f"--{name}", action="store_true", help=text)


def _value(command: _Parser, name: str, metavar: str, text: str, *, default: str | None = None) -> None:
    command.add_argument(f"-{name}", f"--{name}", metavar=metavar, help=text, default=default)


def _scope(command: _Parser) -> None:
    for name, text in (
        ("target", "keep to NODE and what it needs; may be given more than once"),
        ("replace", "make NODE again although nothing moved; may be given more than once"),
    ):
        command.add_argument(f"-{name}", f"--{name}", metavar="NODE", action="append", default=[], help=text)


def _reading(commands: "argparse._SubParsersAction[_Parser]") -> None:
    init = _add(commands, "init", "write a commented octopus.yaml for this host")
    _value(init, "host", "NAME", "the name of the host in the state (default: made from this machine's name)")
    _add(commands, "validate", "check octopus.yaml, specs and profiles; start nothing")
    _add(commands, "schema", "print the JSON Schema of octopus.yaml", json=False)
    explain = _add(commands, "explain", "tell the long story of a diagnostic code")
    explain.add_argument(
        "code", metavar="CODE", nargs="?", help="a code such as IDENTIFY-INVENTED-DEVICE; none lists all"
    )
    graph = _add(commands, "graph", "print the graph of nodes", json=False)
    graph.add_argument("-type", "--type", choices=("dot", "mermaid"), default="dot", help="the drawing language")


def _working(commands: "argparse._SubParsersAction[_Parser]") -> None:
    plan = _add(commands, "plan", "show what would change and why; change nothing")
    _scope(plan)
    _value(plan, "out", "FILE", "save the plan, to be applied later as it is")
    _flag(plan, "detailed-exitcode", "leave with 2 when there are changes")
    _flag(plan, "no-reuse", "plan to run every agent, also where another host has the same accepted output")
    _flag(plan, "destroy", "plan the removal of everything")
    apply = _add(commands, "apply", "do what the plan says")
    apply.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    _scope(apply)
    _flag(apply, "auto-approve", "do not ask")
    _flag(apply, "no-reuse", "run every agent, also where another host has the same accepted output")
    _value(apply, "lock-timeout", "DURATION", "wait so long for the state's lock, such as 30s", default="0s")
    destroy = _add(commands, "destroy", "remove the endpoint, the artifacts and the state of this host")
    _flag(destroy, "auto-approve", "do not ask")
    _value(destroy, "lock-timeout", "DURATION", "wait so long for the state's lock, such as 30s", default="0s")


def _state(commands: "argparse._SubParsersAction[_Parser]") -> None:
    show = _add(commands, "show", "show the state, or a saved plan")
    show.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    state = _add(commands, "state", "look into the state, node by node", json=False)
    verbs = state.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=_Parser)
    _add(verbs, "list", "list the nodes of the state")
    one = _add(verbs, "show", "show one node of the state")
    one.add_argument("node", metavar="NODE")
    forget = _add(verbs, "rm", "forget a node; its artifact stays where it is")
    forget.add_argument("node", metavar="NODE")
    accept = _add(commands, "accept", "take a node's artifact as it is, under the key of today's specs and settings")
    accept.add_argument("node", metavar="NODE")
    _specs(commands)
    _attempts(commands)
    unlock = _add(commands, "force-unlock", "remove the lock of a run that is known to be gone", json=False)
    unlock.add_argument("lock_id", metavar="LOCK-ID")


def _specs(commands: "argparse._SubParsersAction[_Parser]") -> None:
    spec = _add(commands, "spec", "what agents corrected in their own specs", json=False)
    verbs = spec.add_subparsers(dest="verb", metavar="VERB", required=True, parser_class=_Parser)
    one = _add(verbs, "diff", "show the edits that wait for a decision")
    one.add_argument("stage", metavar="STAGE", nargs="?")
    one = _add(verbs, "promote", "write an edit into protocol/; an output that was made with it stays accepted")
    one.add_argument("stage", metavar="STAGE")
    one = _add(verbs, "reset", "drop the edit of a stage, or of all")
    one.add_argument("stage", metavar="STAGE", nargs="?")


def _attempts(commands: "argparse._SubParsersAction[_Parser]") -> None:
    attempts = _add(commands, "attempts", "list what the agents did, the latest last")
    _value(attempts, "stage", "STAGE", "only the attempts of this stage")
    _flag(attempts, "all", "all that are kept, not only the latest")
    verbs = attempts.add_subparsers(dest="verb", metavar="VERB", parser_class=_Parser)
    one = _add(verbs, "show", "show everything that is known of one attempt", json=False)
    one.add_argument("number", metavar="N", type=int)
    record = _add(verbs, "record", "write the last run as a recording, to be played by harness replay", json=False)
    record.add_argument("folder", metavar="DIR")
    text = "only runs that began with attempt N or later"
    record.add_argument("-from", "--from", metavar="N", type=int, default=1, dest="first", help=text)
    for verb in (one, record):
        # The verb's own default would undo a -json that stands before it.
        verb.add_argument("-json", "--json", action="store_true", default=argparse.SUPPRESS, help=_JSON)


def _endpoint(commands: "argparse._SubParsersAction[_Parser]") -> None:
    _add(commands, "status", "tell whether the host is in sync and its endpoint healthy")
    _add(commands, "tools", "list the tools of the live endpoint")
    call = _add(commands, "call", "call a tool of the live endpoint", json=False)
    call.add_argument("tool", metavar="TOOL")
    call.add_argument(
        "-arg", "--arg", metavar="NAME=VALUE", action="append", default=[], help="one argument; repeatable"
    )
    call.add_argument("-json", "--json", metavar="OBJECT", nargs="?", const="", dest="json_arguments", help=_CALL_JSON)
    call.add_argument("-timeout", "--timeout", metavar="DURATION", default="60s", help="give up after so long")


def _agents(commands: "argparse._SubParsersAction[_Parser]") -> None:
    install = _add(commands, "install", "install the programs of harnesses, in versions that octoform was tried with")
    install.add_argument("harness", metavar="HARNESS", nargs="+", help="a harness of octopus.yaml, such as pi or codex")
    _add(commands, "doctor", "check what the chosen harnesses need: programs, keys, models; change nothing")


_CALL_JSON = "all arguments as one JSON object; also makes the output JSON"

_DURATION = re.compile(r"(\d+(?:\.\d+)?)(ms|s|m|h)")


def seconds(text: str) -> float:
    """Seconds of a duration such as ``30s``, ``5m`` or ``1h30m``; UsageError for anything else."""
    units = {"ms": 0.001, "s": 1.0, "m": 60.0, "h": 3600.0}
    pieces = _DURATION.findall(text)
    if not pieces or "".join(number + unit for number, unit in pieces) != text:
        raise UsageError(f"{text!r} is not a duration; write 30s, 5m or 1h30m", "")
    return sum(float(number) * units[unit] for number, unit in pieces)


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The parsed command line; UsageError when it cannot be understood, SystemExit(0) after ``--help``."""
    parser = build()
    arguments = parser.parse_args(list(argv))
    if arguments.command is None and not arguments.version:
        parser.print_help()
        raise SystemExit(1)
    return arguments
