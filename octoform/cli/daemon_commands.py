"""The commands of the daemon: keep the deployment alive, and tell how it is."""

from argparse import RawDescriptionHelpFormatter

from octoform.cli.options import Commands, Parser, add, flag, value

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


def commands_of(commands: Commands) -> None:
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
    episodes = add(commands, "episodes", "list what went wrong, how often, and how long it took until it was over")
    value(episodes, "n", "COUNT", "so many of the latest", default="20")


def _ends(command: Parser, codes: str) -> None:
    """Tell a command's exit codes below its options."""
    command.epilog, command.formatter_class = codes, RawDescriptionHelpFormatter
