"""Everything that the loop remembers, opened together. Light."""

from dataclasses import asdict

from octoform.daemon.store import agent_budget, backoff, incidents
from octoform.daemon.store.agent_budget import AgentBudget
from octoform.daemon.store.backoff import Backoffs
from octoform.daemon.store.incidents import Incidents
from octoform.daemon.store.json_store import Shelf
from octoform.daemon.triage.failure_history import Recall, as_json, from_json
from octoform.diagnostics import warning
from octoform.manifest.model import Daemon
from octoform.records import dataclass, field
from octoform.state.files import display
from octoform.state.layout import Layout

RECALL, REPORT = "recall.json", "report.json"


@dataclass(frozen=True, slots=True)
class LastReport:
    """The stored facts of WATCH: the last ``summary``, when it was last ``asked``, ``since`` when the log counted.

    Times are RFC 3339; empty where it was never asked.
    """

    summary: str | None = None
    since: str = ""
    asked: str = ""


@dataclass(slots=True)
class Memory:
    """Breakers, incidents, spending, and what triage remembers; all of them outlive the daemon."""

    shelf: Shelf
    boot: str
    breakers: Backoffs
    episodes: Incidents
    purse: AgentBudget
    recall: Recall = field(default_factory=Recall)
    report: LastReport = field(default_factory=LastReport)

    @classmethod
    def open(cls, layout: Layout, boot: str, now: float, settings: Daemon) -> "Memory":
        """Take up what is on the disk; ``boot`` names this start of the machine, ``now`` is its uptime in seconds."""
        shelf = Shelf(layout)
        purse = AgentBudget(shelf, boot, settings.calls_per_hour, settings.usd_per_hour)
        found = cls(shelf, boot, Backoffs(shelf, boot, settings.heal_attempts), Incidents(shelf, boot), purse)
        found.breakers.load(now)
        found.episodes.load()
        found.purse.load(now)
        found.recall = _recall(shelf, boot)
        found.report = _report(shelf)
        return found

    def keep(self, recall: Recall) -> None:
        """Remember what triage made of a look; written only when it is new."""
        if recall != self.recall:
            self.recall = recall
            self._save()

    def keep_report(self, report: LastReport) -> None:
        """Remember WATCH's input and report."""
        self.report = report
        self._save_report()

    def reclaim(self) -> None:
        """Write again what somebody else has changed since; `Shelf.strange` names it."""
        files = {
            backoff.FILE: self.breakers.save,
            agent_budget.FILE: self.purse.save,
            incidents.FILE: self.episodes.save,
            RECALL: self._save,
            REPORT: self._save_report,
        }
        for name, save in files.items():
            if not self.shelf.is_mine(name):
                save()

    def _save(self) -> bool:
        return self.shelf.write(RECALL, {"boot": self.boot, "recall": as_json(self.recall)})

    def _save_report(self) -> bool:
        return self.shelf.write(REPORT, asdict(self.report))


def _report(shelf: Shelf) -> LastReport:
    document = shelf.read(REPORT)
    summary, since, asked = (document.get(name) for name in ("summary", "since", "asked"))
    return LastReport(str(summary) if summary else None, str(since or ""), str(asked or ""))


def _recall(shelf: Shelf, boot: str) -> Recall:
    document = shelf.read(RECALL)
    if not document:
        return Recall()
    try:
        found = from_json(document["recall"])
    except (LookupError, TypeError, ValueError, AttributeError, OverflowError):
        path = shelf.path(RECALL)
        shelf.said.append(
            warning("DAEMON-MEMORY-DAMAGED", "it is damaged", path=display(path), hint="it is begun again")
        )
        return Recall()
    # Uptimes of another boot mean nothing, and its process is gone with it.
    return found if document.get("boot") == boot else Recall(failing=found.failing, places=found.places)
