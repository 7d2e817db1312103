"""A profile as a value: the owner's knowledge of one product, and the rule that says when it may be used."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.profiles.evidence import Rule


@dataclass(frozen=True, slots=True)
class Profile:
    """One profile file.

    ``text`` is the whole file, ``body`` its prose, ``digest`` that of its text. ``evidence`` is the rule over what
    PROBE saw. Each of ``limits`` has ``parameter`` and at least one of ``minimum`` and ``maximum`` (numbers), and may
    have ``tool`` (the tool or capability concerned) and ``unit``.
    """

    name: str
    about: str
    path: Path
    text: str
    body: str
    digest: str
    evidence: Rule
    limits: tuple[Mapping[str, Any], ...] = ()
