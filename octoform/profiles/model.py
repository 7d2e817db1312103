"""A profile as a value: the owner's knowledge of one product, and the rule that says when it may be used."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.profiles.evidence import Rule


@dataclass(frozen=True, slots=True)
class Stop:
    """Bytes that the emergency stop writes to the device node of that class; ``baud`` None leaves the line as it is."""

    kind: str
    baud: int | None
    write: bytes


@dataclass(frozen=True, slots=True)
class Profile:
    """One profile file.

    ``text`` is the whole file, ``body`` its prose, ``digest`` that of its text. ``evidence`` is the rule over what
    PROBE saw. Each of ``limits`` has at least one of ``minimum``, ``maximum``, ``step``, ``cumulative`` (numbers, with
    their ``parameter``), ``rate``, ``cooldown`` and ``quiet_hours`` (texts, see `octoform.durations`), and may have
    ``tool`` (a glob over the names of tools and capabilities) and ``unit``. ``stop`` is what the emergency stop does.
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
