"""The agent programs under test, and what each is known to do differently: the data of the tests in this folder.

A program is added by one `Subject`. What stands in no `differs` is what the case itself asks for.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pytest

from octoform.harness.port import ExitReason


@dataclass(frozen=True)
class Expected:
    """How a run ends and whether it leaves an output; None: either is right, since the program decides by chance."""

    reason: ExitReason
    output: bool | None = False


@dataclass(frozen=True)
class Subject:
    """One program: its harness, the model's name in a manifest, the API it is asked to speak (None: its first).

    ``start_seconds`` is how long it may take on a busy machine until its first request. ``differs`` are the cells of
    the failure matrix that its own doing makes different, by the case's name.
    """

    name: str
    model: str = "openai/scripted"
    api: str | None = None
    start_seconds: float = 10.0
    differs: Mapping[str, Expected] = field(default_factory=dict)


SUBJECTS: Mapping[str, Subject] = {
    item.name: item
    for item in (
        Subject("pi", start_seconds=10.0),
        Subject("opencode", start_seconds=20.0),
        Subject("claude-code", model="anthropic/scripted", start_seconds=8.0),
        # It tries again after a 500, and never after a 429.
        Subject("codex", start_seconds=10.0, differs={"500, 429, ok": Expected(ExitReason.RATE_LIMIT)}),
        # Its model's service has no words for broken arguments: it gets a broken call, and asks again in vain.
        Subject(
            "gemini-cli",
            model="gemini/scripted",
            start_seconds=8.0,
            differs={"broken arguments": Expected(ExitReason.FINISHED)},
        ),
        Subject("qwen-code", start_seconds=12.0),
        # Importing the library alone takes seconds.
        Subject("litellm", start_seconds=20.0),
    )
}  # fmt: skip


def _program(item: Subject, *marks: pytest.MarkDecorator) -> Any:
    own = getattr(pytest.mark, f"harness_{item.name.replace('-', '_')}")
    return pytest.param(item, id=item.name, marks=[pytest.mark.harness, own, *marks])


PROGRAMS = [_program(item) for item in SUBJECTS.values()]
"""For ``pytest.mark.parametrize("subject", PROGRAMS)``."""
PATIENT_PROGRAMS = [
    _program(item, *([] if item.name == "pi" else [pytest.mark.patience])) for item in SUBJECTS.values()
]
"""The same for a test that lets seconds pass: with other programs than pi only `make test-harnesses` passes it."""
