"""What the catalog says about a tool before any host is known."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from octoform.builtin.interface.schemas import Schema

Facts = Sequence[Mapping[str, Any]]
"""The ``parameters`` that IDENTIFY gave the capability, one object per device."""


def no_parameters(_: Facts) -> dict[str, Schema]:
    """For tools that need nothing but the device."""
    return {}


@dataclass(frozen=True, slots=True)
class Kind:
    """One capability's tool.

    ``worth`` says what is kept when the tool budget is short: 90 what only hardware can do (see, hear, move), 60 a
    measurement, 30 a description of something that another tool already shows. ``parameters`` makes the properties
    beside ``device``. ``smoke`` are the arguments of a trial call that is quick and changes nothing; only for reads.
    ``units`` names the unit of each bounded parameter, for the tool's limits. ``stops``: it ends a movement that is
    under way, so it does not wait for it. ``acts_on`` is the tool's ``units``: of a device with several, which ones.
    """

    name: str
    description: str
    output: Schema
    worth: int
    effect: str = "read"
    parameters: Callable[[Facts], dict[str, Schema]] = no_parameters
    smoke: Mapping[str, Any] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    idempotent: bool = True
    stops: bool = False
    acts_on: Mapping[str, Any] = field(default_factory=dict)
