"""Everything that the loop remembers, opened together. Light."""

from dataclasses import dataclass, field

from octoform.daemon.records import breakers, episodes, spending
from octoform.daemon.records.breakers import Breakers
from octoform.daemon.records.episodes import Episodes
from octoform.daemon.records.shelf import Shelf
from octoform.daemon.records.spending import Purse
from octoform.daemon.triage.recall import Recall, as_json, from_json
from octoform.diagnostics import warning
from octoform.manifest.model import Daemon
from octoform.state.files import shown
from octoform.state.layout import Layout

RECALL = "recall.json"


@dataclass(slots=True)
class Memory:
    """Breakers, episodes, spending, and what triage remembers; all of them outlive the daemon."""

    shelf: Shelf
    boot: str
    breakers: Breakers
    episodes: Episodes
    purse: Purse
    recall: Recall = field(default_factory=Recall)

    @classmethod
    def open(cls, layout: Layout, boot: str, now: float, settings: Daemon) -> "Memory":
        """Take up what is on the disk; ``boot`` names this start of the machine, ``now`` is its uptime in seconds."""
        shelf = Shelf(layout)
        purse = Purse(shelf, boot, settings.calls_per_hour, settings.usd_per_hour)
        found = cls(shelf, boot, Breakers(shelf, boot, settings.heal_attempts), Episodes(shelf, boot), purse)
        found.breakers.load(now)
        found.episodes.load()
        found.purse.load(now)
        found.recall = _recall(shelf, boot)
        return found

    def keep(self, recall: Recall) -> None:
        """Remember what triage made of a look; written only when it is new."""
        if recall != self.recall:
            self.recall = recall
            self._save()

    def reclaim(self) -> None:
        """Write again what somebody else has changed since; `Shelf.strange` names it."""
        files = {
            breakers.FILE: self.breakers.save,
            spending.FILE: self.purse.save,
            episodes.FILE: self.episodes.save,
            RECALL: self._save,
        }
        for name, save in files.items():
            if not self.shelf.is_mine(name):
                save()

    def _save(self) -> bool:
        return self.shelf.write(RECALL, {"boot": self.boot, "recall": as_json(self.recall)})


def _recall(shelf: Shelf, boot: str) -> Recall:
    document = shelf.read(RECALL)
    if not document:
        return Recall()
    try:
        found = from_json(document["recall"])
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError):
        path = shelf.path(RECALL)
        shelf.said.append(warning("DAEMON-MEMORY-DAMAGED", "it is damaged", path=shown(path), hint="it is begun anew"))
        return Recall()
    # Uptimes of another boot mean nothing, and its process is gone with it.
    return found if document.get("boot") == boot else Recall(failing=found.failing, places=found.places)
