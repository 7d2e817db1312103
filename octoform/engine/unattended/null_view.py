"""The view of a run that nobody watches; what it does stands in the execution log."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from octoform.engine.results import RunResult
from octoform.events import Event
from octoform.plan.model import Plan


class Unwatched:
    """Shows nothing, and can ask nobody."""

    def plan(self, plan: Plan) -> None:
        """Nobody looks at it."""

    def approve(self) -> bool:
        """Nobody can be asked."""
        return False

    @contextmanager
    def watching(self) -> Iterator[Callable[[Event], None]]:
        """Events are only logged."""
        yield lambda _: None

    def ended(self, result: RunResult) -> None:
        """Nobody is shown it."""
