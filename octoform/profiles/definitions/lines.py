"""The grammar of a line protocol, as data: which lines a product understands and what it answers. Pure.

A grammar is a closed list of typed commands, so an agent can make one tool for each of them and nothing else: no
line reaches the device that does not stand here, with parameters that keep to what stands here.
"""

from dataclasses import dataclass
from typing import Any

from octoform.profiles.definitions.values import Tool, Value, plain_values, present


@dataclass(frozen=True, slots=True)
class Line:
    """How the product talks: one command a line over the device node of class ``kind``.

    ``ending`` ends a line in both directions, ``ok`` is the answer of a command that was done (None: the product
    acknowledges nothing), ``error`` the pattern of one that was refused (``ERR {message}``; None: it has none).
    ``timeout`` is the longest time until the answer and ``settle`` the pause after the line was opened, in seconds.
    """

    kind: str
    baud: int
    ending: str
    ok: str | None
    error: str | None
    timeout: float
    settle: float = 0.0


@dataclass(frozen=True, slots=True)
class Command:
    """One command and the tool that it becomes; ``send`` and ``reply`` are patterns with ``{name}`` for each value.

    ``send`` empty: nothing is sent, the product speaks by itself. ``reply`` has a pattern for each line of the answer;
    empty: the answer is the grammar's ``ok``, and there are no ``fields``.
    """

    tool: str
    send: str
    about: str
    effect: str
    parameters: tuple[Value, ...] = ()
    reply: tuple[str, ...] = ()
    fields: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True)
class Axis:
    """One axis of a counted position: the command that moves it, and the parameter that says by how much."""

    name: str
    tool: str
    parameter: str


@dataclass(frozen=True, slots=True)
class Position:
    """A tool that tells where a product without a measurement must be, by what it acknowledged since ``zero``."""

    tool: str
    about: str
    axes: tuple[Axis, ...]
    zero: str


@dataclass(frozen=True, slots=True)
class Halt:
    """A tool after which nothing more is sent to the product, until the command ``until`` went well."""

    tool: str
    about: str
    until: str


@dataclass(frozen=True, slots=True)
class LineGrammar:
    """All that may be said to a product that is driven by lines of text."""

    line: Line
    commands: tuple[Command, ...]
    position: Position | None = None
    stop: Halt | None = None

    def tools(self) -> tuple[Tool, ...]:
        """One tool for each command, then those that say nothing to the product."""
        found = [Tool(item.tool, item.about, item.effect, item.parameters) for item in self.commands]
        if self.position is not None:
            found.append(Tool(self.position.tool, self.position.about, "read", do="position"))
        if self.stop is not None:
            found.append(Tool(self.stop.tool, self.stop.about, "actuate", do="stop"))
        return tuple(found)


def plain(grammar: LineGrammar) -> dict[str, Any]:
    """The grammar as JSON; members without a value are left out."""
    line, position, stop = grammar.line, grammar.position, grammar.stop
    told = {"class": line.kind, "baud": line.baud, "ending": line.ending, "ok": line.ok, "error": line.error}
    times = {"timeout": line.timeout, "settle": line.settle or None}
    more: dict[str, Any] = {}
    if position is not None:
        axes = {axis.name: {"tool": axis.tool, "parameter": axis.parameter} for axis in position.axes}
        more["position"] = {"tool": position.tool, "about": position.about, "axes": axes, "zero": position.zero}
    if stop is not None:
        more["stop"] = {"tool": stop.tool, "about": stop.about, "until": stop.until}
    commands = [_command(item) for item in grammar.commands]
    commands += [
        {"tool": item.tool, "do": item.do, "about": item.about, "effect": item.effect, "parameters": {}}
        for item in grammar.tools()
        if item.do
    ]
    return {"line": present({**told, **times}), **more, "commands": commands}


def _command(command: Command) -> dict[str, Any]:
    told = {"tool": command.tool, "send": command.send or None, "about": command.about, "effect": command.effect}
    fields = plain_values(command.fields) or None
    parameters = plain_values(command.parameters)
    # One line stands as it was written; several are a list.
    reply = command.reply[0] if len(command.reply) == 1 else list(command.reply) or None
    return present({**told, "parameters": parameters, "reply": reply, "fields": fields})
