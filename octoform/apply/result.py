"""How the work on one node ended."""

from dataclasses import dataclass

from octoform.apply.gate import Verdict
from octoform.harness.port import Usage


@dataclass(frozen=True, slots=True)
class Finished:
    """``verdict`` is the accepted one, or the last refusal; ``attempts`` counts the agent runs.

    ``program`` is the agent's program of the last of them with its version, where it is known.
    """

    verdict: Verdict
    attempts: int
    usage: Usage
    seconds: float
    program: str | None = None
