"""The command line: commands, options and their help.

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
    """The command that states more than this one, for a command that has no ``-v``."""

    def error(self, message: str) -> NoReturn:
        """Raise UsageError."""
        raise UsageError(message, self.format_usage())

    def _check_value(self, action: argparse.Action, value: str) -> None:
        """One that is not among forty is reported with the one that was meant, not with all of them."""
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
        text = f"did you mean -{near}?" if near and kind == "option" else f"{self.prog} --help lists what there is"
        if kind == "word" and "=" in word and "-arg" in self._option_string_actions:
            text = f"an argument of a tool is written -arg {word}"
        elif kind == "option" and name in ("v", "verbose") and self.more:
            text = f"{self.more} shows more"
        raise UsageError(f"{self.prog} knows no {kind} {word!r}; {text}", self.format_usage())

    def _get_option_tuples(self, _: str) -> list[tuple[argparse.Action, str, str | None]]:
        """No abbreviations: argparse would take `-auto` for `-auto-approve`, whatever ``allow_abbrev`` states."""
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


_CALL_JSON = "all arguments as one JSON object; also makes the output JSON"
_CLIENT = "an MCP client, such as claude-code, codex or vscode"
_START = "start the endpoint even after `octoform stop`; otherwise only `start` and `apply` do so"
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
    add(commands, "start", "start the endpoint unless it already runs")
    stop = add(commands, "stop", "stop the endpoint: ask its process to end, kill it after 8 s")
    stop.add_argument("host", metavar="HOST", nargs="?", help="another host of this folder, also a former one")
    add(commands, "restart", "stop the endpoint and start it again")
    status = add(commands, "status", "show if the host is in sync and its endpoint healthy")
    status.more = "octoform health"
    logs = add(commands, "logs", "show the endpoint's calls and what its process printed")
    logs.add_argument("-f", "--follow", action="store_true", dest="follow", help="keep printing new lines")
    value(logs, "n", "LINES", "show the latest LINES lines", default="50")
    service = add(commands, "service", "let systemd run the endpoint and its daemon", json=False)
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
    tools = add(commands, "tools", "list the tools of the live endpoint")
    tools.add_argument("tools", metavar="TOOL", nargs="*", help="a tool to show (default: all)")
    flag(tools, "start", _START)
    call = add(commands, "call", "call a tool of the live endpoint", json=False)
    call.add_argument("tool", metavar="TOOL", nargs="?", help="the tool (default: a read-only tool, as an example)")
    call.add_argument("-arg", "--arg", metavar="NAME=VALUE", action="append", default=[], help="argument; repeatable")
    call.add_argument("-json", "--json", metavar="OBJECT", nargs="?", const="", dest="json_arguments", help=_CALL_JSON)
    value(call, "timeout", "DURATION", "give up after DURATION", default="60s")
    flag(call, "dry-run", "report what the call would do, and do nothing")
    flag(call, "auto-approve", "confirm calls for which the policy requires consent")
    flag(call, "start", _START)


def _looking(commands: Commands) -> None:
    look = add(commands, "look", "take a picture through the endpoint and report what it shows")
    value(look, "device", "ID", "look through this camera (default: the one of the step perceive, else the best)")
    value(look, "save", "FILE", "write the picture to FILE; with -every each name gets a number")
    text = "take a picture every DURATION until Ctrl-C (default: the interval in octopus.yaml)"
    look.add_argument("-every", "--every", metavar="DURATION", nargs="?", const="", help=text)
    value(look, "count", "N", "end after N pictures; only with -every")


def _clients(commands: Commands) -> None:
    connect = add(commands, "connect", "connect an MCP client to the endpoint (its stdio command)", json=False)
    connect.add_argument("host", metavar="HOST", nargs="?", help="the host (default: the only one of this project)")
    value(connect, "print", "CLIENT", f"print the configuration for {_CLIENT}; connect to nothing")
    value(connect, "transport", "KIND", _TRANSPORT)
    flag(connect, "start", _START)
    verbs = verbs_of(add(commands, "clients", "add the endpoint to the configuration files of MCP clients", json=False))
    add(verbs, "list", "list the clients, their files, and which of them have the endpoint")
    for name, text in (
        ("install", "add the endpoint to a client's file; a backup is kept"),
        ("remove", "remove the endpoint from a client's file"),
    ):
        verb = add(verbs, name, text)
        verb.add_argument("client", metavar="CLIENT", help=_CLIENT)
        value(verb, "transport", "KIND", _TRANSPORT)


def _access(commands: Commands) -> None:
    verbs = verbs_of(add(commands, "token", "manage the tokens that give access over the network", json=False))
    create = add(verbs, "create", "make a token; its value is shown once and kept with mode 0600")
    create.add_argument("name", metavar="NAME")
    value(create, "effects", "LIST", "which tools it may call: read, actuate, irreversible", default="read")
    value(create, "expires", "DURATION", "the token expires after DURATION, such as 24h (default: never)")
    add(verbs, "list", "list the tokens, not their values")
    for name, text in (
        ("show", "print the value of a token"),
        ("rotate", "give a token a new value; the old one ends at once"),
        ("revoke", "end a token at once"),
    ):
        add(verbs, name, text).add_argument("name", metavar="NAME")
    add(commands, "revoke", "end the tunnel of scope internet and verify that it is gone")


def _guarding(commands: Commands) -> None:
    estop = add(commands, "estop", "emergency stop: refuse all actuators and run the stop actions")
    flag(estop, "clear", "end the emergency stop")
    value(estop, "reason", "TEXT", "the reason, for the audit log")
    audit = add(commands, "audit", "show which calls were allowed, refused and approved")
    flag(audit, "verify", "check that no record was changed, removed or added")
    value(audit, "n", "LINES", "show the latest LINES records", default="50")
    value(audit, "tool", "TOOL", "only records of this tool")
    flag(audit, "refused", "only calls that were refused")
    text = "only records after WHEN: a duration back from now (1h30m) or a time (2026-05-04T12:00:00Z)"
    value(audit, "since", "WHEN", text)
    value(audit, "client", "TEXT", "only calls whose client, token or process number contains TEXT, and their results")
    limits = add(commands, "limits", "show the limits and how much of each is used")
    value(limits, "reset", "TOOL", "reset the counters of a tool")


# The commands of the daemon: keep the deployment working, and report its state.

_CODES = """\
exit codes{}:
  0  healthy: all checks pass
  3  degraded: something is wrong, and the rest works
  4  error: tools cannot work until it is repaired
  5  down: the endpoint does not run or does not answer
  6  unknown: a check has no data
  1  the command itself failed; the reason is on standard error
"""
_OF_WATCH = """\
  128 and the number of the signal that ended it (130 for Ctrl-C); with -once the code of the health that it left:
  0 healthy, 3 degraded, 4 error, 5 down, 6 unknown; 1 for an error, such as a daemon that runs already
"""


def _daemon(commands: Commands) -> None:
    """Add them all."""
    watch = add(commands, "watch", "keep the deployment working: detect faults and repair them")
    flag(watch, "once", "run one check cycle with all repairs that are due, then exit")
    _ends(watch, f"exit codes:\n{_OF_WATCH}")
    _ends(add(commands, "health", "show the health of the deployment, each problem, and what to do"), _CODES.format(""))
    heal = add(commands, "heal", "check and repair now; list the problems that were given up")
    text = "try again to repair TARGET, such as endpoint or tool:move_rail; `all` for everything"
    value(heal, "retry", "TARGET", text)
    _ends(heal, _CODES.format(", where no daemon runs and heal makes one check cycle (else 0: the daemon was asked)"))
    claims = add(commands, "claims", "list the claims about the hardware and their evidence")
    flag(claims, "all", "also expired and refuted claims, with the reason")
    value(claims, "retire", "ID", "withdraw a claim that is in force")
    confirm = add(commands, "confirm", "approve or reject a claim or a rewrite that needs a person")
    text = "a claim as `octoform claims` shows it, or a rewrite as its notice names it (default: list what waits)"
    confirm.add_argument("claim", metavar="ID", nargs="?", help=text)
    flag(confirm, "reject", "reject it")
    flag(confirm, "auto-approve", "do not ask")
    add(commands, "pause", "pause the daemon's repairs until `resume`; it goes on observing")
    add(commands, "resume", "resume the daemon's repairs")
    incidents = add(commands, "incidents", "list what went wrong, how often, and how long it lasted; or show one")
    incidents.add_argument("show", metavar="show N", nargs="*", help="show incident N, with the reasons of its repairs")
    value(incidents, "n", "COUNT", "show the latest COUNT incidents", default="20")


RENAMED = {"accept": ("state", "adopt"), "episodes": ("incidents",)}
"""Commands by their former names, which work in one version more."""


def _ends(command: Parser, codes: str) -> None:
    """Show a command's exit codes below its options."""
    command.epilog, command.formatter_class = codes, RawDescriptionHelpFormatter


EXIT_CODES = """\
exit codes:
  0    done; for `plan -detailed-exitcode`: no changes
  1    an error; the reason is on standard error
  2    for `plan -detailed-exitcode`: there are changes; for `look`: the picture is black, uniform or frozen
  3    for `status`, `health`, `heal` and `watch -once`: degraded; 4: error, 5: down, 6: unknown, 0: healthy;
       for `apply`: done, but this user may not use a served device
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
    parser.add_argument("-version", "--version", action="store_true", help="print the version and exit")
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
        ("target", "only NODE and the nodes that it needs; may be given more than once"),
        ("replace", "create NODE again although nothing changed; may be given more than once"),
    ):
        command.add_argument(f"-{name}", f"--{name}", metavar="NODE", action="append", default=[], help=text)


def _reading(commands: Commands) -> None:
    init = add(commands, "init", "write a commented octopus.yaml for this host")
    value(init, "host", "NAME", "the name of the host in the state (default: derived from this machine's name)")
    add(commands, "validate", "check octopus.yaml, specs and profiles; start nothing")
    add(commands, "schema", "print the JSON Schema of octopus.yaml", json=False)
    explain = add(commands, "explain", "explain a diagnostic code")
    text = "a code such as IDENTIFY-INVENTED-DEVICE (default: list all codes)"
    explain.add_argument("code", metavar="CODE", nargs="?", help=text)
    graph = add(commands, "graph", "print the graph of nodes", json=False)
    graph.add_argument("-type", "--type", choices=("dot", "mermaid"), default="dot", help="the drawing language")


_TIER1 = "without profiles and answers, as if no person had described the hardware"


def _working(commands: Commands) -> None:
    plan = add(commands, "plan", "show what would change and why; change nothing")
    _scope(plan)
    value(plan, "out", "FILE", "save the plan, for `apply FILE`")
    flag(plan, "detailed-exitcode", "exit with 2 when there are changes")
    flag(plan, "no-reuse", "run every agent; do not reuse the accepted output of another host")
    flag(plan, "tier1", _TIER1)
    flag(plan, "destroy", "plan the removal of everything that apply created")
    apply = add(commands, "apply", "show the plan, ask, and carry it out")
    apply.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    _scope(apply)
    flag(apply, "auto-approve", "do not ask")
    flag(apply, "no-reuse", "run every agent; do not reuse the accepted output of another host")
    flag(apply, "tier1", _TIER1)
    flag(apply, "ask", "on a terminal: ask about each unknown device, then plan and apply once more")
    value(apply, "lock-timeout", "DURATION", "wait up to DURATION for the state's lock, such as 30s", default="0s")
    _answering(commands)
    destroy = add(commands, "destroy", "remove the endpoint, the artifacts and the state of this host")
    flag(destroy, "auto-approve", "do not ask")
    value(destroy, "lock-timeout", "DURATION", "wait up to DURATION for the state's lock, such as 30s", default="0s")


def _answering(commands: Commands) -> None:
    answer = add(commands, "answer", "answer the question about a device; without DEVICE, list the open questions")
    answer.add_argument("device", metavar="DEVICE", nargs="?", help="the device's id, as plan shows it")
    answer.add_argument("sentence", metavar="SENTENCE", nargs="?", help="what it is (default: ask on the terminal)")
    flag(answer, "remove", "remove the answer about DEVICE")


def _state(commands: Commands) -> None:
    show = add(commands, "show", "show the state, or a saved plan")
    show.add_argument("planfile", metavar="PLANFILE", nargs="?", help="a plan saved with `plan -out`")
    devices = add(commands, "devices", "list the devices, their tools, and where each is attached now")
    flag(devices, "v", "also serial numbers, evidence, doubts, and skipped devices with the reason")
    state = add(commands, "state", "show the nodes of the state, or change one", json=False)
    verbs = verbs_of(state)
    add(verbs, "list", "list the nodes of the state")
    one = add(verbs, "show", "show one node of the state")
    one.add_argument("node", metavar="NODE")
    forget = add(verbs, "rm", "forget a node; its artifact file stays")
    forget.add_argument("node", metavar="NODE")
    adopt = add(verbs, "adopt", "verify a node's artifact and keep it under the current specs and settings")
    adopt.add_argument("node", metavar="NODE")
    _specs(commands)
    _profiles(commands)
    _attempts(commands)
    _coverage(commands)
    unlock = add(commands, "force-unlock", "remove the lock of a run that no longer exists", json=False)
    unlock.add_argument("lock_id", metavar="LOCK-ID")


def _specs(commands: Commands) -> None:
    spec = add(commands, "spec", "show, keep or drop the corrections that agents made to specs", json=False)
    verbs = verbs_of(spec)
    one = add(verbs, "diff", "show the corrections that wait for a decision")
    one.add_argument("stage", metavar="STAGE", nargs="?")
    one = add(verbs, "promote", "write a correction into protocol/; the output made with it stays accepted")
    one.add_argument("stage", metavar="STAGE")
    one = add(verbs, "reset", "drop the correction of a stage, or of all stages")
    one.add_argument("stage", metavar="STAGE", nargs="?")


def _profiles(commands: Commands) -> None:
    profile = add(commands, "profile", "draft a profile, or check which devices a profile matches", json=False)
    verbs = verbs_of(profile)
    one = add(verbs, "new", "draft profiles/NAME.md from PROBE's record of a device")
    one.add_argument("device", metavar="DEVICE")
    one = add(verbs, "check", "check a profile and explain which devices of the known hosts it matches")
    one.add_argument("file", metavar="FILE")


def _attempts(commands: Commands) -> None:
    attempts = add(commands, "attempts", "list the attempts of the agents, the latest last")
    value(attempts, "stage", "STAGE", "only the attempts of this stage")
    flag(attempts, "all", "all attempts that are kept, not only the latest")
    verbs = attempts.add_subparsers(dest="verb", metavar="VERB", parser_class=Parser)
    one = add(verbs, "show", "show everything that is recorded of one attempt", json=False)
    one.add_argument("number", metavar="N", type=int)
    record = add(verbs, "record", "write the last run as a recording for the harness replay", json=False)
    record.add_argument("folder", metavar="DIR")
    record.add_argument("-from", "--from", metavar="N", type=int, default=1, dest="first", help="begin with attempt N")
    for verb in (one, record):
        # The verb's own default would undo a -json that stands before it.
        verb.add_argument("-json", "--json", action="store_true", default=argparse.SUPPRESS, help=JSON_HELP)


def _coverage(commands: Commands) -> None:
    coverage = add(commands, "coverage", "show which hardware is usable, and why the rest is not")
    value(coverage, "html", "FILE", "write the report as an HTML page instead")
    flag(coverage, "all", "also every skipped device, every disagreement, every run")


def _agents(commands: Commands) -> None:
    install = add(commands, "install", "install agent programs, in versions that octoform was tested with")
    install.add_argument("harness", metavar="HARNESS", nargs="+", help="a harness of octopus.yaml, such as pi or codex")
    add(commands, "doctor", "check the programs, keys and models that octopus.yaml needs")
    _simulating(commands)


def _about(commands: Commands) -> None:
    shown = add(commands, "help", "show the commands, or the options of one", json=False)
    shown.add_argument("words", metavar="COMMAND", nargs="*")
    add(commands, "version", "print the version")
    completion = add(commands, "completion", "print a script that completes commands and options", json=False)
    completion.add_argument("shell", metavar="SHELL", choices=("bash", "zsh", "fish"), help="bash, zsh or fish")


def _simulating(commands: Commands) -> None:
    simulate = add(commands, "simulate", "run simulated devices until Ctrl-C, in place of hardware")
    simulate.add_argument("rig", metavar="RIG", help="the name of a rig, such as reference, or a .yaml file")
    value(simulate, "folder", "DIR", "create the devices in DIR, empty or missing so far (default: a new folder)")
    text = "change a value of the rig's description, such as arm.anonymous=true; may be given more than once"
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
    """The parsed command line, with the former name of its command as ``renamed``; UsageError, or SystemExit(0)."""
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
