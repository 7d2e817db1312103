"""The command grammar of a line protocol, as data: which lines a product understands and what it answers. Pure.

A grammar is a closed list of typed commands, so an agent can make one tool for each of them and nothing else: no
line reaches the device that does not stand here, with parameters that keep to what stands here.
"""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, slots=True)
class Line:
    """How the product talks: one command a line over the device node of class ``kind``.

    ``ending`` ends a line in both directions, ``ok`` is the answer of a command that was done, ``error`` the pattern
    of one that was refused (``ERR {message}``; None: it has none). ``timeout`` is the longest time until the answer
    and ``settle`` the pause after the line was opened, both in seconds.
    """

    kind: str
    baud: int
    ending: str
    ok: str
    error: str | None
    timeout: float
    settle: float = 0.0


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of a command or a field of its answer: integer, number, or (with ``choices``) a word of a list."""

    name: str
    type: str
    about: str = ""
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    choices: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Command:
    """One command and the tool that it becomes; ``send`` and ``reply`` are patterns with ``{name}`` for each value.

    ``reply`` None: the answer is the grammar's ``ok``, and there are no ``fields``.
    """

    tool: str
    send: str
    about: str
    effect: str
    parameters: tuple[Value, ...] = ()
    reply: str | None = None
    fields: tuple[Value, ...] = ()


@dataclass(frozen=True, slots=True)
class Grammar:
    """All that may be said to the product."""

    line: Line
    commands: tuple[Command, ...]


def plain(grammar: Grammar) -> dict[str, Any]:
    """The grammar as JSON, as an agent's task has it; members without a value are left out."""
    line = grammar.line
    told = {"class": line.kind, "baud": line.baud, "ending": line.ending, "ok": line.ok, "error": line.error}
    times = {"timeout": line.timeout, "settle": line.settle or None}
    return {"line": _told({**told, **times}), "commands": [_command(item) for item in grammar.commands]}


def _command(command: Command) -> dict[str, Any]:
    parameters = {item.name: _value(item) for item in command.parameters}
    fields = {item.name: _value(item) for item in command.fields}
    told = {"tool": command.tool, "send": command.send, "about": command.about, "effect": command.effect}
    return _told({**told, "parameters": parameters, "reply": command.reply, "fields": fields or None})


def _value(value: Value) -> dict[str, Any]:
    bounds = {"minimum": value.minimum, "maximum": value.maximum, "enum": list(value.choices) or None}
    return _told({"type": value.type, "about": value.about or None, "unit": value.unit or None, **bounds})


def _told(members: dict[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in members.items() if value is not None}
