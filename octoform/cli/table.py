"""The commands of octoform: name, group, line of help, what each needs of its folder; and how arguments are declared.

The rows are text alone: a command's module, ``commands/GROUP.py``, is imported only once the command was chosen. There
``run_NAME(arguments, run)`` carries it out, and the annotation of ``arguments`` is the class that declares what can be
typed, each argument once with its type. A verb is a command of two words; its first word is a command of its own, or
only the heading of its verbs.
"""

from __future__ import annotations

TYPE_CHECKING = False  # as type checkers know it: typing brings the library of expressions with it
if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence
    from typing import Any, ClassVar, TypeVar, dataclass_transform

    T = TypeVar("T")
    Declared = Any
else:
    Declared = object

    def dataclass_transform(**_):
        """For type checkers alone."""
        return lambda made: made


GROUPS = {
    "main": "main commands",
    "inspect": "inspect the project, its state and its health",
    "operate": "operate the endpoint and its daemon",
    "safety": "safety: who may do what, and the emergency stop",
    "clients": "clients: use the endpoint, and add it to other programs",
    "agents": "agents: their programs, their attempts, and what they work with",
}
READS, LASTING, HEADING = "reads", "lasting", "heading"
"""Writes nothing into the project; runs until it is stopped; is only the heading of its verbs."""
HOST, HERE, NOWHERE = "host", "here", "nowhere"
"""Where it works, when not in the nearest folder with a manifest: there, on its host; in this folder; in none."""


class UsageError(Exception):
    """The command line could not be understood; carries the message and, where one is known, the usage line."""

    def __init__(self, message: str, usage: str = "") -> None:
        super().__init__(message)
        self.usage = usage


class Command:
    """A row of the table, each of its ``traits`` one of those above."""

    __slots__ = ("group", "help", "name", "traits")

    def __init__(self, group: str, name: str, help: str, *traits: str) -> None:
        self.group, self.name, self.help, self.traits = group, name, help, traits

    def verbs(self) -> dict[str, Command]:
        """The commands that are verbs of this one."""
        return {each.name.split()[1]: each for each in COMMANDS if each.name.startswith(f"{self.name} ")}


ROWS: dict[str, tuple[tuple[str, ...], ...]] = {
    "main": (
        ("init", "write a commented octopus.yaml for this host", HERE),
        ("validate", "check octopus.yaml, specs and profiles; start nothing", READS),
        ("plan", "show what would change and why; change nothing", READS),
        ("apply", "show the plan, ask, and carry it out"),
        ("answer", "answer the question about a device; without DEVICE, list the open questions"),
        ("destroy", "remove the endpoint, the artifacts and the state of this host"),
    ),
    "inspect": (
        ("status", "show if the host is in sync and its endpoint healthy", READS),
        ("health", "show the health of the deployment, each problem, and what to do", READS),
        ("incidents", "list what went wrong, how often, and how long it lasted", HOST, READS),
        ("incidents show", "show one incident, with the reasons of its repairs", READS),
        ("logs", "show the endpoint's calls and what its process printed", READS),
        ("devices", "list the devices, their tools, and where each is attached now", READS),
        ("coverage", "show which hardware is usable, and why the rest is not", READS),
        ("show", "show the state, or a saved plan", READS),
        ("state", "show the nodes of the state, or change one", HEADING),
        ("state list", "list the nodes of the state"),
        ("state show", "show one node of the state"),
        ("state rm", "forget a node; its artifact file stays"),
        ("state adopt", "verify a node's artifact and keep it under the current specs and settings"),
        ("graph", "print the graph of nodes", READS),
        ("explain", "explain a diagnostic code", NOWHERE),
        ("schema", "print the JSON Schema of octopus.yaml", NOWHERE),
        ("help", "show the commands, or the options of one", NOWHERE),
        ("version", "print the version", NOWHERE),
        ("completion", "print a script that completes commands and options", NOWHERE),
    ),
    "operate": (
        ("start", "start the endpoint unless it already runs"),
        ("stop", "stop the endpoint: ask its process to end, kill it after 8 s"),
        ("restart", "stop the endpoint and start it again"),
        ("watch", "keep the deployment working: detect faults and repair them", LASTING),
        ("heal", "check and repair now; list the problems that were given up", HOST),
        ("pause", "pause the daemon's repairs until `resume`; it goes on observing", HOST),
        ("resume", "resume the daemon's repairs", HOST),
        ("service", "let systemd run the endpoint and its daemon", HEADING),
        ("service install", "show the systemd units, then write and start them"),
        ("service uninstall", "stop and remove the units"),
        ("force-unlock", "remove the lock of a run that no longer exists"),
    ),
    "safety": (
        ("estop", "emergency stop: refuse all actuators and run the stop actions", HERE),
        ("limits", "show the limits and how much of each is used"),
        ("audit", "show which calls were allowed, refused and approved"),
        ("claims", "list the claims about the hardware and their evidence"),
        ("confirm", "approve or reject a claim or a rewrite that needs a person"),
        ("token", "manage the tokens that give access over the network", HEADING),
        ("token create", "make a token; its value is shown once and kept with mode 0600"),
        ("token list", "list the tokens, not their values"),
        ("token show", "print the value of a token"),
        ("token rotate", "give a token a new value; the old one ends at once"),
        ("token revoke", "end a token at once"),
        ("revoke", "end the tunnel of scope internet and verify that it is gone"),
    ),
    "clients": (
        ("tools", "list the tools of the live endpoint"),
        ("call", "call a tool of the live endpoint"),
        ("look", "take a picture through the endpoint and report what it shows"),
        ("connect", "connect an MCP client to the endpoint (its stdio command)", HERE),
        ("clients", "add the endpoint to the configuration files of MCP clients", HEADING),
        ("clients list", "list the clients, their files, and which of them have the endpoint"),
        ("clients install", "add the endpoint to a client's file; a backup is kept"),
        ("clients remove", "remove the endpoint from a client's file"),
    ),
    "agents": (
        ("install", "install agent programs, in versions that octoform was tested with"),
        ("doctor", "check the programs, keys and models that octopus.yaml needs", READS),
        ("attempts", "list the attempts of the agents, the latest last", READS),
        ("attempts show", "show everything that is recorded of one attempt", READS),
        ("attempts record", "write the last run as a recording for the harness replay", READS),
        ("spec", "show, keep or drop the corrections that agents made to specs", HEADING),
        ("spec diff", "show the corrections that wait for a decision"),
        ("spec promote", "write a correction into protocol/; the output made with it stays accepted"),
        ("spec reset", "drop the correction of a stage, or of all stages"),
        ("profile", "draft a profile, or check which devices a profile matches", HEADING),
        ("profile new", "draft profiles/NAME.md from PROBE's record of a device"),
        ("profile check", "check a profile and explain which devices of the known hosts it matches"),
        ("simulate", "run simulated devices until Ctrl-C, in place of hardware", HERE),
    ),
}
"""By group: name, help, traits."""
COMMANDS = tuple(Command(group, *row) for group, rows in ROWS.items() for row in rows)
FORMER = {"accept": "state adopt", "episodes": "incidents"}
"""Commands by their former names, which work in one version more."""
OPTIONS = {
    "h": ("-h, -help", "show this help message and exit"),
    "chdir": ("-chdir DIR", "work in DIR, the folder of octopus.yaml (default: this folder, else the nearest above)"),
    "no-color": ("-no-color", "no colour"),
    "version": ("-version", "print the version and exit"),
}
"""The options before a command, each with its form and its help."""
SEE_HELP = "see octoform --help"
EXIT_CODES = """\
exit codes:
  0    done; for `plan -detailed-exitcode`: no changes
  1    an error; the reason is on standard error
  2    for `plan -detailed-exitcode`: there are changes; for `look`: the picture is black, uniform or frozen
  3    for `status`, `health`, `heal` and `watch -once`: degraded; 4: error, 5: down, 6: unknown, 0: healthy;
       for `apply`: done, but this user may not use a served device
  129  stopped by SIGHUP: its terminal was closed
  130  interrupted from the keyboard
  143  stopped by SIGTERM"""
HEALTH_CODES = """\
exit codes{}:
  0  healthy: all checks pass
  3  degraded: something is wrong, and the rest works
  4  error: tools cannot work until it is repaired
  5  down: the endpoint does not run or does not answer
  6  unknown: a check has no data
  1  the command itself failed; the reason is on standard error
"""


def chosen(words: Sequence[str]) -> tuple[Command, list[str]]:
    """The command that the words begin with, and the words for it; an option may stand before a verb.

    UsageError where there is no such command or verb, with the one that was meant.
    """
    name, *rest = [*FORMER.get(words[0], words[0]).split(), *words[1:]]
    tops = {each.name: each for each in COMMANDS if " " not in each.name}
    command = _named(tops, name, "command", "")
    verbs = command.verbs()
    at = next((at for at, word in enumerate(rest) if not word.startswith("-")), None)
    verb = None if at is None else rest[at]
    if at is not None and verb is not None and verbs and (verb in verbs or at == 0 or HEADING in command.traits):
        return _named(verbs, verb, "verb", usage(command)), rest[:at] + rest[at + 1 :]
    return command, rest


def _named(known: dict[str, Command], name: str, kind: str, usage_line: str) -> Command:
    if name in known:
        return known[name]
    from octoform.diagnostics import did_you_mean  # only a slip pays for it

    near = did_you_mean(name, list(known))
    every = f"there are {', '.join(known)}" if kind == "verb" else "octoform help lists the commands"
    raise UsageError(f"there is no {kind} {name!r}; {f'did you mean {near}?' if near else every}", usage_line)


def usage(heading: Command | None = None) -> str:
    """The usage line of octoform, or of a command that has verbs alone."""
    if heading is not None:
        return f"usage: octoform {heading.name} [-h] VERB ..."
    return "usage: octoform [-h] [-chdir DIR] [-no-color] [-version] COMMAND ..."


def overview(heading: Command | None = None) -> Iterator[str]:
    """The lines of the help on all commands in their groups, or on the verbs of one."""
    yield usage(heading)
    yield ""
    if heading is not None:
        yield from (heading.help, "", *verbs_of(heading))
        return
    yield "Infrastructure as Code for the hardware of a host."
    for group, title in GROUPS.items():
        tops = (each for each in COMMANDS if each.group == group and " " not in each.name)
        yield from ("", f"{title}:", *(_row(each.name, each.help) for each in tops))
    yield from ("", "options:", *(_row(form, text) for form, text in OPTIONS.values()), "", *EXIT_CODES.split("\n"))


def _row(name: str, text: str) -> str:
    return f"  {name:<13} {text}"


def verbs_of(command: Command) -> list[str]:
    """The lines of help on the verbs of a command; empty where it has none."""
    rows = [_row(verb, each.help) for verb, each in command.verbs().items()]
    return ["verbs:", *rows] if rows else []


class Argument(Declared):  # type: ignore[misc]
    """What a class declares: an option in its forms, or an operand, and what argparse is given for it.

    For type checkers it is of any type: it stands where the attribute's value will be.
    """

    __slots__ = ("forms", "given", "kind")

    def __init__(self, forms: Sequence[str] | None, kind: Callable[[str], Any] | None, **given: Any) -> None:
        """``forms``: empty for an option that is called as its attribute, None for an operand."""
        self.forms, self.kind, self.given = forms, kind, given

    @property
    def is_required(self) -> bool:
        """Whether a command cannot do without it."""
        return self.forms is None and self.given.get("nargs") not in ("?", "*")

    def untyped(self) -> Any:
        """Its value where it was not typed."""
        if self.given.get("action") == "store_true":
            return False
        value = self.given.get("default", [] if self.given.get("nargs") == "*" else None)
        if isinstance(value, list):
            return [*value]
        return self.kind(value) if isinstance(value, str) and self.kind is not None else value

    def names(self, attribute: str) -> Sequence[str]:
        """The forms of the option; of an operand its attribute."""
        if self.forms is None:
            return (attribute,)
        word = attribute.replace("_", "-")
        return self.forms or (f"-{word}", f"--{word}")


def flag(help: str, *forms: str) -> bool:
    """An option without a value."""
    return Argument(forms, None, action="store_true", help=help)


def option(kind: Callable[[str], T], metavar: str, help: str, *forms: str, empty: str | None = None) -> T | None:
    """An option with a value, which may be omitted where there is one for it (``empty``).

    ``kind`` converts the value, or raises a ValueError whose text states what is wrong with it.
    """
    more = {} if empty is None else {"nargs": "?", "const": empty}
    return Argument(forms, kind, metavar=metavar, help=help, **more)


def setting(
    kind: Callable[[str], T], metavar: str, help: str, *forms: str, default: str, choices: Sequence[str] | None = None
) -> T:
    """An option with a value where none is given; see `option`."""
    return Argument(forms, kind, metavar=metavar, help=help, default=default, choices=choices)


def repeated(metavar: str, help: str) -> list[str]:
    """An option with a value that may be given more than once."""
    return Argument((), None, metavar=metavar, help=help, action="append", default=[])


def operand(kind: Callable[[str], T], metavar: str, help: str = "", *, choices: Sequence[str] | None = None) -> T:
    """A word that must be given; see `option`."""
    return Argument(None, kind, metavar=metavar, help=help or None, choices=choices)


def optional(metavar: str, help: str = "") -> str | None:
    """A word that may be given."""
    return Argument(None, None, metavar=metavar, help=help or None, nargs="?")


def operands(metavar: str, help: str = "", *, required: bool = False) -> list[str]:
    """All further words."""
    return Argument(None, None, metavar=metavar, help=help or None, nargs="+" if required else "*")


@dataclass_transform(
    frozen_default=True,
    kw_only_default=True,
    field_specifiers=(flag, option, setting, repeated, operand, optional, operands),
)
class Arguments:
    """What can be typed behind a command, as attributes with their types; a command declares a class of its own."""

    epilog: ClassVar[str] = ""
    """What stands below the options in the help."""
    more: ClassVar[str] = ""
    """The command that states more than this one, for a command that has no ``-v``."""
    exclusive: ClassVar[tuple[str, ...]] = ()
    """Options of which one may be given."""

    no_color: bool = flag("no colour")

    def __init__(self, **given: Any) -> None:
        self.__dict__.update(given)

    def __setattr__(self, name: str, _: object) -> None:
        """Refused: they stay as they were typed."""
        raise AttributeError(f"cannot assign to argument {name!r}")

    @classmethod
    def declared(cls) -> Iterator[tuple[str, Argument]]:
        """The arguments by the names of their attributes, those that all commands have first."""
        for each in reversed(cls.__mro__):
            yield from ((name, found) for name, found in vars(each).items() if isinstance(found, Argument))

    @classmethod
    def untyped(cls) -> Arguments | None:
        """The arguments where nothing was typed, for which no parser is needed; None where something must be."""
        declared = dict(cls.declared())
        if any(each.is_required for each in declared.values()):
            return None
        return cls(**{name: each.untyped() for name, each in declared.items()})

    @property
    def as_json(self) -> bool:
        """Whether a program reads the output."""
        return bool(vars(self).get("json"))


class Json(Arguments):
    """Arguments of a command that has its output for programs too."""

    json: bool = flag("machine-readable output on standard output")


def file_name(text: str) -> str:
    """The name of a file that is to be written."""
    if not text:
        raise ValueError("give the file that is to be written")
    return text


def words(text: str) -> list[str]:
    """The words of a list with commas."""
    return text.replace(",", " ").split()


def duration(text: str) -> float:
    """Seconds of a duration such as ``30s``, ``1.5m`` or ``1h30m``."""
    from octoform.base import durations

    length = durations.seconds(text)
    if length is None:
        raise ValueError(f"{text!r} is no duration; {durations.HINT}")
    return length


def number(text: str, what: str = "number") -> int:
    """An integer without a sign."""
    if not text.isascii() or not text.isdigit():
        raise ValueError(f"{text!r} is not a {what}")
    return int(text)


def number_of(things: str) -> Callable[[str], int]:
    """The kind of an option that states how many."""
    return lambda text: number(text, f"number of {things}")
