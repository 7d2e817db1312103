"""How the work on one node ended."""

from dataclasses import dataclass

from octoform.apply.gate import Verdict
from octoform.harness.port import Usage


@dataclass(frozen=True, slots=True)
class Finished:
    """``verdict`` is the accepted one, or the last refusal; ``attempts`` counts the agent runs."""

    verdict: Verdict
    attempts: int
    usage: Usage
    seconds: float
