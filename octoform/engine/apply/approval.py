"""The question whether new hardware shall be onboarded: kept until an apply answers it. Light.

One question at a time, and the same one as long as the hardware and the reason for asking are the same.
"""

import json
from dataclasses import asdict

from octoform.base.clock import stamp
from octoform.base.digest import of_value
from octoform.base.files import parse, private_folder, record
from octoform.diagnostics import Diagnostic
from octoform.records import dataclass
from octoform.state.files import read_regular, write_atomic
from octoform.state.layout import Layout

FORMAT = 1
ASKS = "asks.json"
MAX_LINES = 100
"""Entries of hardware that are kept; a hub full of devices has fewer."""


@dataclass(frozen=True, slots=True)
class Question:
    """``hardware`` as ``create ENTRY`` or ``destroy ENTRY``, ``nodes`` that an apply would run, ``why`` it is asked."""

    hardware: tuple[str, ...]
    nodes: tuple[str, ...]
    why: tuple[str, ...]
    at: str = ""

    @property
    def text(self) -> str:
        """The question in one line."""
        return f"octoform apply would onboard what changed; it is not done by itself, because {'; '.join(self.why)}"


def ask(layout: Layout, question: Question) -> tuple[bool, Diagnostic | None]:
    """Keep the question: whether it is a new one, and why it could not be kept."""
    mark = _mark(question)
    there = read(layout)
    if there is not None and _mark(there) == mark:
        return False, None
    document = {
        "format": FORMAT,
        **asdict(question),
        "hardware": question.hardware[:MAX_LINES],
        "at": stamp(),
        "question": question.text,
    }
    private_folder(layout.daemon)
    return True, write_atomic(layout.daemon / ASKS, json.dumps(document, indent=1).encode(), 0o600)


def read(layout: Layout) -> Question | None:
    """The question that waits; None when there is none, or none that can be read."""
    data, _ = read_regular(layout.daemon / ASKS)
    try:
        fields = record(parse(data or b""), FORMAT)
        hardware, nodes, why = (tuple(str(one) for one in fields[name]) for name in ("hardware", "nodes", "why"))
        return Question(hardware, nodes, why, str(fields["at"]))
    except (ValueError, LookupError, TypeError):
        return None


def withdraw(layout: Layout) -> None:
    """Take the question back: an apply has answered it, or the hardware is as it was."""
    (layout.daemon / ASKS).unlink(missing_ok=True)


def _mark(question: Question) -> str:
    return of_value({"hardware": question.hardware[:MAX_LINES], "why": question.why})
