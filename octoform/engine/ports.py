"""What the engine asks of a view during a run."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Protocol

from octoform.engine.results import RunResult
from octoform.events import Event
from octoform.plan.model import Plan


class RunView(Protocol):
    """Shows a run and asks for approval."""

    def plan(self, plan: Plan) -> None:
        """Show what is going to be done."""

    def approve(self) -> bool:
        """Ask the person; False when the answer is not yes or nobody can be asked."""

    def watching(self) -> AbstractContextManager[Callable[[Event], None]]:
        """A context that gives the sink for events."""

    def ended(self, result: RunResult) -> None:
        """Show how it ended."""
