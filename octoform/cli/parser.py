"""What can be typed: commands, options and their help.

Options have Terraform's form (``-target NODE``, ``-auto-approve``); the same names work with two dashes. Usage errors
leave with status 1, because 2 is an answer: "changes" in ``plan -detailed-exitcode``, "nothing to be seen" in ``look``.
"""

import argparse
from collections.abc import Sequence

from octoform import durations
from octoform.cli import daemon_commands, endpoint_commands
from octoform.cli.options import JSON_HELP, Commands, Parser, UsageError, add, flag, value, verbs_of

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


def build() -> Parser:
    """The parser of all commands; cheap enough to be built for ``--help`` on a small board."""
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
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", title="commands", parser_class=Parser)
    _reading(commands)
    _working(commands)
    _state(commands)
    endpoint_commands.commands_of(commands)
    daemon_commands.commands_of(commands)
    _agents(commands)
    _about(commands)
    return parser


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


_TIER1 = "as if nobody had said anything of the hardware: without profiles and answers"


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
    accept = add(commands, "accept", "take a node's artifact as it is, under the key of today's specs and settings")
    accept.add_argument("node", metavar="NODE")
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
    flag(coverage, "all", "every device that is left out, every disagreement, every run")


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


def parse(argv: Sequence[str]) -> argparse.Namespace:
    """The parsed command line; UsageError when it cannot be understood, SystemExit(0) after ``--help``."""
    parser = build()
    arguments, rest = parser.parse_known_args(list(argv))
    getattr(arguments, "parser", parser).check_rest(rest)
    if arguments.command is None and not arguments.version:
        parser.print_help()
        raise SystemExit(1)
    return arguments
