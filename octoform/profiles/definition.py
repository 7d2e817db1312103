"""The command grammar of a product, as data of one of two kinds: lines of text, or the registers of units on a bus."""

from typing import Any

from octoform.profiles import lines, registers
from octoform.profiles.definition_values import Tool, Value
from octoform.profiles.lines import Axis, Command, Halt, Line, LineGrammar, Position
from octoform.profiles.registers import RegisterGrammar

__all__ = [
    "Axis",
    "Command",
    "Grammar",
    "Halt",
    "Line",
    "LineGrammar",
    "Position",
    "RegisterGrammar",
    "Tool",
    "Value",
    "plain",
]

Grammar = LineGrammar | RegisterGrammar


def plain(grammar: Grammar, *, of_product: bool = False) -> dict[str, Any]:
    """The grammar as JSON, as an agent's task has it; members without a value are left out.

    ``of_product`` leaves out what is true of the owner's own copy alone.
    """
    if isinstance(grammar, RegisterGrammar):
        return registers.plain(grammar, of_product=of_product)
    return lines.plain(grammar)
