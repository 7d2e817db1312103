"""What can be typed: commands, options and their help.

Options have Terraform's form (``-target NODE``, ``-auto-approve``); the same names work with two dashes. Usage errors
leave with status 1, because 2 is an answer: "changes" in ``plan -detailed-exitcode``, "nothing to be seen" in ``look``.
"""

import argparse
from argparse import RawDescriptionHelpFormatter
from collections.abc import Sequence
from functools import partial
from typing import Any, NoReturn, TypeAlias

from octoform.base import durations
from octoform.diagnostics import did_you_mean

# The words of which all commands' options are made.
#
# Options have Terraform's form (``-target NODE``); the same names work with two dashes.

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

    more: str = ""
    """The command that says more than this one, for a command that has no ``-v``."""

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
        if kind == "word" and "=" in word and "-arg" in self._option_string_actions:
            said = f"an argument of a tool is written -arg {word}"
        elif kind == "option" and name in ("v", "verbose") and self.more:
            said = f"{self.more} says more"
        raise UsageError(f"{self.prog} knows no {kind} {word!r}; {said}", self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` says."""
        return []


class Unbuilt(Parser):
    """A command that was not chosen: its name and its line of help, and none of its options."""

    def __init__(self, **_: Any) -> None:
        """Nothing is made; a board of 1 GHz takes 20 ms for the options of all commands."""

    def add_argument(self, *_: Any, **__: Any) -> Any:
        """No option."""

    def set_defaults(self, **_: Any) -> None:
        """No default."""

    def add_subparsers(self, **_: Any) -> Any:
        """Verbs that are no more than this."""
        return self

    def add_parser(self, *_: Any, **__: Any) -> "Unbuilt":
        """A verb."""
        return self

    def add_mutually_exclusive_group(self, **_: Any) -> Any:
        """No option, whichever."""
        return self


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


# The commands for the live endpoint: run it, use it, guard it, let clients in.

_CALL_JSON = "all arguments as one JSON object; also makes the output JSON"
_CLIENT = "an MCP client, such as claude-code, codex or vscode"
_START = "start the endpoint although `octoform stop` ended it, which nothing else but `start` and `apply` does"
_TRANSPORT = "stdio or http (default: what the scope calls for)"


def _endpoint(commands: Commands) -> None:
    """Add them all."""
    _running(commands)
    _calling(commands)
    _looking(commands)
    _clients(commands)
    _access(commands)
    _guarding(commands)


def _running(commands: Commands) -> None:
    add(commands, "start", "start the endpoint; nothing is done when it runs")
    stop = add(commands, "stop", "stop the endpoint: first gracefully, then firmly")
    stop.add_argument("host", metavar="HOST", nargs="?", help="another host of this folder, also a former one")
    add(commands, "restart", "stop the endpoint and start it again")
    status = add(commands, "status", "tell whether the host is in sync and its endpoint healthy")
    status.more = "octoform health"
    logs = add(commands, "logs", "show what the endpoint did: its calls and what it printed")
    logs.add_argument("-f", "--follow", action="store_true", dest="follow", help="go on as new lines come")
    value(logs, "n", "LINES", "so many of the latest lines", default="50")
    service = add(commands, "service", "have systemd run the endpoint and its daemon", json=False)
    verbs = verbs_of(service)
    for name, text in (
        ("install", "show the systemd units, then write and start them"),
        ("uninstall", "stop and remove the units"),
    ):
        verb = add(verbs, name, text, json=False)
        ways = verb.add_mutually_exclusive_group()
        flag(ways, "user", "for this user's systemd")
        flag(ways, "print", "only print the units for the whole machine, and what to do with them as root")
        flag(verb, "auto-approve", "do not ask")


def _calling(commands: Commands) -> None:
    flag(add(commands, "tools", "list the tools of the live endpoint"), "start", _START)
    call = add(commands, "call", "call a tool of the live endpoint", json=False)
    call.add_argument("tool", metavar="TOOL", nargs="?", help="without one, a reading tool is called as an example")
    text = "one argument; repeatable"
    call.add_argument("-arg", "--arg", metavar="NAME=VALUE", action="append", default=[], help=text)
    call.add_argument("-json", "--json", metavar="OBJECT", nargs="?", const="", dest="json_arguments", help=_CALL_JSON)
    value(call, "timeout", "DURATION", "give up after so long", default="60s")
    flag(call, "dry-run", "tell what would be done, and do nothing")
    flag(call, "auto-approve", "approve what the policy wants confirmed")
    flag(call, "start", _START)


def _looking(commands: Commands) -> None:
    look = add(commands, "look", "take a picture through the endpoint and tell what it shows")
    value(look, "device", "ID", "look through this camera (default: the one of the step perceive, else the best)")
    value(look, "save", "FILE", "write the picture there; with -every each gets a number in its name")
    text = "look again at every DURATION, until Ctrl-C; without one as octopus.yaml says"
    look.add_argument("-every", "--every", metavar="DURATION", nargs="?", const="", help=text)
    value(look, "count", "N", "end after N looks; only with -every")


def _clients(commands: Commands) -> None:
    connect = add(commands, "connect", "a client's stdio command: a pipe to the endpoint", json=False)
    connect.add_argument("host", metavar="HOST", nargs="?", help="the host (default: the only one of this project)")
    value(connect, "print", "CLIENT", f"print the configuration for {_CLIENT}; connect to nothing")
    value(connect, "transport", "KIND", _TRANSPORT)
    flag(connect, "start", _START)
    verbs = verbs_of(add(commands, "clients", "put the endpoint into the configuration of MCP clients", json=False))
    add(verbs, "list", "list the clients, their files, and whether the endpoint is in them")
    for name, text in (("install", "add the endpoint to a client's file; a backup is kept"), ("remove", "take it out")):
        verb = add(verbs, name, text)
        verb.add_argument("client", metavar="CLIENT", help=_CLIENT)
        value(verb, "transport", "KIND", _TRANSPORT)


def _access(commands: Commands) -> None:
    verbs = verbs_of(add(commands, "token", "who may reach the endpoint over the network", json=False))
    create = add(verbs, "create", "make a token; its value is shown once and kept with mode 0600")
    create.add_argument("name", metavar="NAME")
    value(create, "effects", "LIST", "what it may call: read, actuate, irreversible", default="read")
    value(create, "expires", "DURATION", "it ends after so long, such as 24h (default: never)")
    add(verbs, "list", "list the tokens, not their values")
    for name, text in (
        ("show", "print the value of a token"),
        ("rotate", "give a token a new value; the old one ends at once"),
        ("revoke", "end a token at once"),
    ):
        add(verbs, name, text).add_argument("name", metavar="NAME")
    add(commands, "revoke", "end the tunnel of scope internet, and prove that it is gone")


def _guarding(commands: Commands) -> None:
    estop = add(commands, "estop", "refuse every actuator at once and run the stop actions; engaged until cleared")
    flag(estop, "clear", "allow actuators again")
    value(estop, "reason", "TEXT", "why; it is kept in the audit log")
    audit = add(commands, "audit", "show what was allowed, refused and approved")
    flag(audit, "verify", "check that no record was changed, removed or added")
    value(audit, "n", "LINES", "so many of the latest records", default="50")
    value(audit, "tool", "TOOL", "only records of this tool")
    flag(audit, "refused", "only calls that were refused")
    value(
        audit, "since", "WHEN", "only from then on: a duration back from now (1h30m) or a time (2026-05-04T12:00:00Z)"
    )
    value(audit, "client", "TEXT", "only calls of clients, tokens or process numbers like this, and what came of them")
    limits = add(commands, "limits", "show the limits and what is used of them")
    value(limits, "reset", "TOOL", "set the sums of a tool to zero")


# The commands of the daemon: keep the deployment alive, and tell how it is.

_CODES = """\
exit codes{}:
  0  healthy: everything that should report does, and nothing is wrong
  3  degraded: something is wrong, and the rest works
  4  error: tools cannot work until it is repaired
  5  down: the endpoint does not run or does not answer
  6  unknown: something that should report does not
  1  the command itself failed; the reason is on standard error
"""
_OF_WATCH = """\
  128 and the number of the signal that ended it (130 for Ctrl-C); with -once the code of the health that it left:
  0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 for an error, such as a daemon that runs already
"""


def _daemon(commands: Commands) -> None:
    """Add them all."""
    watch = add(commands, "watch", "keep the deployment alive: notice what happens, repair what can be repaired")
    flag(watch, "once", "one look with all repairs that are due, then leave")
    _ends(watch, f"exit codes:\n{_OF_WATCH}")
    health = add(commands, "health", "tell how the deployment is, what is wrong since when, and what to do")
    _ends(health, _CODES.format(""))
    heal = add(commands, "heal", "look and repair now; list what was given up after its tries")
    text = "try TARGET again although it was given up, such as endpoint or tool:move_rail; `all` is everything"
    value(heal, "retry", "TARGET", text)
    _ends(heal, _CODES.format(", where no daemon runs and one round is made here (else 0: it was asked)"))
    claims = add(commands, "claims", "list what agents and persons claim of the hardware, and what each rests on")
    flag(claims, "all", "also those that are over, with the reason")
    value(claims, "retire", "ID", "take back a claim that is in force")
    confirm = add(commands, "confirm", "say yes or no to a claim that only a person may make true")
    confirm.add_argument(
        "claim",
        metavar="ID",
        nargs="?",
        help="a claim, as `octoform claims` shows it, or a rewrite that a notice names; without it, list what waits",
    )
    flag(confirm, "reject", "say no")
    flag(confirm, "auto-approve", "do not ask")
    add(commands, "pause", "let the daemon repair nothing until `resume`; it goes on looking")
    add(commands, "resume", "let the daemon repair again")
    incidents = add(commands, "incidents", "list what went wrong, how often, and how long it took until it was over")
    value(incidents, "n", "COUNT", "so many of the latest", default="20")


RENAMED = {"accept": ("state", "adopt"), "episodes": ("incidents",)}
"""Commands by their former names, which work in one version more."""


def _ends(command: Parser, codes: str) -> None:
    """Tell a command's exit codes below its options."""
    command.epilog, command.formatter_class = codes, RawDescriptionHelpFormatter


EXIT_CODES = """\
exit codes:
  0    done; for `plan -detailed-exitcode`: no changes
  1    an error; the reason is on standard error
  2    for `plan -detailed-exitcode`: there are changes; for `look`: the picture shows nothing
  3    for `status`, `health`, `heal` and `watch -once`: degraded; 4: error, 5: down, 6: unknown, 0: healthy;
       for `apply`: done, and this user may not use a served device
  129  stopped by SIGHUP: its terminal was closed
  130  interrupted from the keyboard
  143  stopped by SIGTERM
"""


def build(chosen: str | None = None) -> Parser:
    """The parser of all commands; with ``chosen``, of that one alone, the others being names with a line of help."""
    parser = Parser(
        prog="octoform",
        description="Infrastructure as Code for the hardware of a host.",
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    text = "work in DIR, the folder of octopus.yaml (default: this folder, else the nearest above that has one)"
    parser.add_argument("-chdir", "--chdir", metavar="DIR", help=text)
    parser.add_argument("-no-color", "--no-color", action="store_true", help="no colour")
    parser.add_argument("-version", "--version", action="store_true", help="print the version and leave")
    made = partial(_built, chosen)
    commands: Commands = parser.add_subparsers(  # type: ignore[call-overload]
        dest="command", metavar="COMMAND", title="commands", parser_class=made
    )
    _reading(commands)
    _working(commands)
    _state(commands)
    _endpoint(commands)
    _daemon(commands)
    _agents(commands)
    _about(commands)
    return parser


def _built(chosen: str | None, **given: Any) -> Parser:
    return Parser(**given) if chosen in (None, given["prog"].split()[-1]) else Unbuilt()


def _scope(command: Parser) -> None:
    for name, text in (
        ("target", "keep to NODE and what it needs; may be given more than once"),
        ("replace", "make NODE again although nothing moved; may be given more than once"),
    ):
        command.add_argument(f"-{name}", f"--{name}", metavar="NODE", action="append", default=[], help=text)


def _reading(commands: Commands) -> None:
    init = add(commands, "init", "write a commented octopus.yaml for this host")
    value(init, "host", "NAME", "the name of the host in the state (default: made from this machine's name)")
    add(commands, "validate", "check octopus.yaml, specs and profiles; start nothing")
    add(commands, "schema", "print the JSON Schema of octopus.yaml", json=False)
    explain = add(commands, "explain", "tell the long story of a diagnostic code")
    explain.add_argument(
        "code", metavar="CODE", nargs="?", help="a code such as IDENTIFY-INVENTED-DEVICE; none lists all"
    )
    graph = add(commands, "graph", "print the graph of nodes", json=False)
    graph.add_argument("-type", "--type", choices=("dot", "mermaid"), default="dot", help="the drawing language")


_TIER1 = "as if no one had said anything of the hardware: without profiles and answers"


def _working(commands: Commands) -> None:
    plan = add(commands, "plan", "show what would change and why; change nothing")
    _scope(plan)
    value(plan, "out", "FILE", "save the plan, to be applied later as it is")
    flag(plan, "detailed-exitcode", "leave with 2 when there are changes")
    flag(plan, "no-reuse", "plan to run every agent, also where another host has the same accepted output")
    flag(plan, "tier1", _TIER1)
    flag(plan, "destroy", "plan the removal of everything")
    apply = add(commands, "apply", "do what the plan says")
    apply.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    _scope(apply)
    flag(apply, "auto-approve", "do not ask")
    flag(apply, "no-reuse", "run every agent, also where another host has the same accepted output")
    flag(apply, "tier1", _TIER1)
    flag(apply, "ask", "on a terminal: ask about each device that is still unknown, then plan and apply once more")
    value(apply, "lock-timeout", "DURATION", "wait so long for the state's lock, such as 30s", default="0s")
    _answering(commands)
    destroy = add(commands, "destroy", "remove the endpoint, the artifacts and the state of this host")
    flag(destroy, "auto-approve", "do not ask")
    value(destroy, "lock-timeout", "DURATION", "wait so long for the state's lock, such as 30s", default="0s")


def _answering(commands: Commands) -> None:
    answer = add(commands, "answer", "say in a sentence what a device is; without one, list what is asked")
    answer.add_argument("device", metavar="DEVICE", nargs="?", help="the device's id, as plan shows it")
    answer.add_argument("sentence", metavar="SENTENCE", nargs="?", help="what it is; without it a terminal is asked")
    flag(answer, "remove", "take back what was said of DEVICE")


def _state(commands: Commands) -> None:
    show = add(commands, "show", "show the state, or a saved plan")
    show.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    devices = add(commands, "devices", "list the devices, their tools, and where each is attached now")
    flag(devices, "v", "also serial numbers, evidence, what is in doubt, and what was skipped and why")
    state = add(commands, "state", "look into the state, node by node", json=False)
    verbs = verbs_of(state)
    add(verbs, "list", "list the nodes of the state")
    one = add(verbs, "show", "show one node of the state")
    one.add_argument("node", metavar="NODE")
    forget = add(verbs, "rm", "forget a node; its artifact stays where it is")
    forget.add_argument("node", metavar="NODE")
    adopt = add(verbs, "adopt", "take a node's artifact as it is, under the input hash of today's specs and settings")
    adopt.add_argument("node", metavar="NODE")
    _specs(commands)
    _profiles(commands)
    _attempts(commands)
    _coverage(commands)
    unlock = add(commands, "force-unlock", "remove the lock of a run that is known to be gone", json=False)
    unlock.add_argument("lock_id", metavar="LOCK-ID")


def _specs(commands: Commands) -> None:
    spec = add(commands, "spec", "what agents corrected in their own specs", json=False)
    verbs = verbs_of(spec)
    one = add(verbs, "diff", "show the edits that wait for a decision")
    one.add_argument("stage", metavar="STAGE", nargs="?")
    one = add(verbs, "promote", "write an edit into protocol/; an output that was made with it stays accepted")
    one.add_argument("stage", metavar="STAGE")
    one = add(verbs, "reset", "drop the edit of a stage, or of all")
    one.add_argument("stage", metavar="STAGE", nargs="?")


def _profiles(commands: Commands) -> None:
    profile = add(commands, "profile", "begin a profile, or see for which devices one holds and why", json=False)
    verbs = verbs_of(profile)
    one = add(verbs, "new", "draft profiles/NAME.md from what PROBE saw of a device")
    one.add_argument("device", metavar="DEVICE")
    one = add(verbs, "check", "check a profile and explain on which known hosts its evidence rule holds")
    one.add_argument("file", metavar="FILE")


def _attempts(commands: Commands) -> None:
    attempts = add(commands, "attempts", "list what the agents did, the latest last")
    value(attempts, "stage", "STAGE", "only the attempts of this stage")
    flag(attempts, "all", "all that are kept, not only the latest")
    verbs = attempts.add_subparsers(dest="verb", metavar="VERB", parser_class=Parser)
    one = add(verbs, "show", "show everything that is known of one attempt", json=False)
    one.add_argument("number", metavar="N", type=int)
    record = add(verbs, "record", "write the last run as a recording, to be played by harness replay", json=False)
    record.add_argument("folder", metavar="DIR")
    text = "only runs that began with attempt N or later"
    record.add_argument("-from", "--from", metavar="N", type=int, default=1, dest="first", help=text)
    for verb in (one, record):
        # The verb's own default would undo a -json that stands before it.
        verb.add_argument("-json", "--json", action="store_true", default=argparse.SUPPRESS, help=JSON_HELP)


def _coverage(commands: Commands) -> None:
    coverage = add(commands, "coverage", "show what of the hardware is usable, what is not and why")
    value(coverage, "html", "FILE", "write the report as a page of its own instead")
    flag(coverage, "all", "every device that is skipped, every disagreement, every run")


def _agents(commands: Commands) -> None:
    install = add(commands, "install", "install the programs of harnesses, in versions that octoform was tried with")
    install.add_argument("harness", metavar="HARNESS", nargs="+", help="a harness of octopus.yaml, such as pi or codex")
    add(commands, "doctor", "check what the chosen harnesses need: programs, keys, models; change nothing")
    _simulating(commands)


def _about(commands: Commands) -> None:
    text = "show the commands, or the options of one"
    add(commands, "help", text, json=False).add_argument("words", metavar="COMMAND", nargs="*")
    add(commands, "version", "print the version")
    completion = add(commands, "completion", "print a script that completes commands and options", json=False)
    completion.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")


def _simulating(commands: Commands) -> None:
    simulate = add(commands, "simulate", "run simulated devices until Ctrl-C, to be used in place of hardware")
    simulate.add_argument("rig", metavar="RIG", help="a rig by its name, such as reference, or a .yaml file")
    value(simulate, "folder", "DIR", "make the devices in DIR, which is empty or not there (default: a new one)")
    text = "another value in the rig's description, such as arm.anonymous=true; may be given more than once"
    simulate.add_argument("-set", "--set", metavar="NAME.KEY=VALUE", action="append", default=[], help=text)


def seconds(text: str) -> float:
    """Seconds of a duration such as ``30s``, ``1.5m`` or ``1h30m``; UsageError for anything else."""
    length = durations.seconds(text)
    if length is None:
        raise UsageError(f"{text!r} is no duration; {durations.HINT}", "")
    return length


def _chosen(argv: Sequence[str]) -> str:
    """The command among the words: the first that is neither an option nor the folder of ``-chdir``."""
    words = [word for before, word in zip(("", *argv), argv, strict=False) if before not in ("-chdir", "--chdir")]
    return next((word for word in words if not word.startswith("-")), "")


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The parsed command line; UsageError when it cannot be understood, SystemExit(0) after ``--help``.

    ``renamed`` is the former name by which the command was called, None for its own.
    """
    former = _chosen(argv)
    if former in RENAMED:
        at = next(at for at, word in enumerate(argv) if word == former and argv[max(0, at - 1)].lstrip("-") != "chdir")
        argv = [*argv[:at], *RENAMED[former], *argv[at + 1 :]]
    parser = build(_chosen(argv))
    arguments, rest = parser.parse_known_args(list(argv))
    arguments.renamed = former if former in RENAMED else None
    getattr(arguments, "parser", parser).check_rest(rest)
    if arguments.command is None and not arguments.version:
        parser.print_help()
        raise SystemExit(1)
    return arguments
