"""While an agent works, nobody but the daemon changes the daemon's own files: its memory, and the ledger of claims.

An agent of the same account could write them. What the daemon knows is written again, and what the agent says then
counts for nothing. A person decides about claims before or afterwards (`octoform.daemon.claim_decisions`
says so). Light.
"""

from dataclasses import dataclass, replace

from octoform.claims.ledger import Ledger
from octoform.daemon.model import Done
from octoform.daemon.store.state import Memory


@dataclass(slots=True)
class Untouched:
    """Watches the files of one daemon; one agent works at a time, or several under one guard."""

    memory: Memory
    ledger: Ledger
    _at_work: int = 0

    def begin(self) -> None:
        """An agent is about to be asked: what changed until now was changed by others."""
        if not self._at_work:
            self.ledger.expire()  # takes up what a person decided
            self.memory.reclaim()
            self.memory.shelf.strange.clear()
            self.ledger.strange = 0
            self.ledger.guarded = True
        self._at_work += 1

    def end(self, done: Done) -> Done:
        """It has ended: its word, or that it is refused."""
        self.ledger.expire()
        self.memory.reclaim()
        names = sorted(self.memory.shelf.strange) + ["the ledger of claims"] * bool(self.ledger.strange)
        self._at_work -= 1
        self.ledger.guarded = self._at_work > 0
        if not names:
            return done
        text = f"refused: while the agent was at work, somebody changed {', '.join(names)} ({done.detail})"
        return replace(done, ok=False, report=None, findings=(), detail=text)
