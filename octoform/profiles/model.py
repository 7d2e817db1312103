"""A profile as a value: the owner's knowledge of one product, and the rule that states when it may be used."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.profiles import lines, registers
from octoform.profiles.lines import LineDefinition
from octoform.profiles.match_rule import Rule
from octoform.profiles.registers import RegisterDefinition
from octoform.records import dataclass, field

Grammar = LineDefinition | RegisterDefinition
"""How a product is spoken to: lines of text, or the registers of units on a bus."""


def plain(grammar: Grammar, *, of_product: bool = False) -> dict[str, Any]:
    """The protocol definition as JSON, as an agent's task has it; members without a value are omitted.

    ``of_product`` leaves out what is true of the owner's own copy alone.
    """
    if isinstance(grammar, RegisterDefinition):
        return registers.plain(grammar, of_product=of_product)
    return lines.plain(grammar)


@dataclass(frozen=True, slots=True)
class Stop:
    """Bytes that the emergency stop writes to the device node of that class; ``baud`` None leaves the line as it is."""

    kind: str
    baud: int | None
    write: bytes


@dataclass(frozen=True, slots=True)
class Rig:
    """The facts of the owner's own unit alone: facts in sentences, and limits beside the product's.

    ``disabled`` are units of its protocol definition that are never moved, each with the reason, ``units`` bus ids that
    differ.
    """

    facts: tuple[str, ...] = ()
    limits: tuple[Mapping[str, Any], ...] = ()
    disabled: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Profile:
    """One profile file.

    ``text`` is the whole file, ``body`` its prose, ``digest`` that of its text. ``evidence`` is the rule over what
    PROBE saw. Each of ``limits`` has settings of `octoform.policy.kinds` as they are written, those for a value with
    their ``parameter``, and may have ``tool`` (a glob over the names of tools and capabilities) and ``unit``; the
    bounds of the protocol definition's parameters are among them, and those of the rig come last. ``stop`` is what the
    emergency stop does, ``grammar`` the commands of a product that is driven by lines or by registers, as it is on
    this rig. ``product`` is the product's own name, empty where ``about`` states it. ``rig`` is what is true of the
    owner's own copy alone.
    """

    name: str
    about: str
    path: Path
    text: str
    body: str
    digest: str
    evidence: Rule
    limits: tuple[Mapping[str, Any], ...] = ()
    stop: tuple[Stop, ...] = ()
    grammar: Grammar | None = None
    product: str = ""
    rig: Rig = Rig()

    @property
    def describes(self) -> bool:
        """Whether it defines a protocol that is not public; behind a public library a name is enough."""
        return isinstance(self.grammar, LineDefinition)
