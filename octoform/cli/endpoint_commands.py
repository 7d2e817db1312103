"""The commands for the live endpoint: run it, use it, guard it, let clients in."""

from octoform.cli.options import Commands, add, flag, value, verbs_of

_CALL_JSON = "all arguments as one JSON object; also makes the output JSON"
_CLIENT = "an MCP client, such as claude-code, codex or vscode"
_START = "start the endpoint although `octoform stop` ended it, which nothing else but `start` and `apply` does"
_TRANSPORT = "stdio or http (default: what the scope calls for)"


def commands_of(commands: Commands) -> None:
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
    add(commands, "status", "tell whether the host is in sync and its endpoint healthy")
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
    estop = add(commands, "estop", "refuse every actuator at once and run the stop actions; latched until cleared")
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
