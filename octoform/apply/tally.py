"""What one run has done so far, for its closing lines and its record."""

from dataclasses import dataclass, field

from octoform.diagnostics import Diagnostic
from octoform.harness.port import Usage


@dataclass(slots=True)
class Tally:
    """Counts of nodes and of agent runs, what those used, the node that failed, and what was found.

    ``alike`` counts nodes that were made again and came out the same: they are not among ``changed``.
    """

    added: int = 0
    changed: int = 0
    alike: int = 0
    destroyed: int = 0
    agent_runs: int = 0
    usage: Usage = field(default_factory=Usage)
    failed: str | None = None
    diagnostics: list[Diagnostic] = field(default_factory=list)
