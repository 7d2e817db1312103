"""WATCH, HEAL and ROLL_BACK as the loop's repairs: the brief goes to a child, the report comes back. Light."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from octoform.daemon.model import Done, Finding, Repair
from octoform.daemon.ports import Repairer
from octoform.daemon.repair.dispatch import Run, done

SECONDS = {Repair.WATCH: 900.0, Repair.HEAL: 2400.0, Repair.ROLL_BACK: 300.0}
"""Above what the manifest lets an agent take, so that its own budget ends it first."""
LEAVING = frozenset({Repair.HEAL, Repair.ROLL_BACK, Repair.REDISCOVER})
"""Repairs that exchange what is served before it is proved."""
SETTLE_SECONDS = 180.0


class Agents:
    """The repairs that ask an agent, and those that do not in front of it."""

    def __init__(self, host: str, run: Run, plain: Repairer) -> None:
        """``plain`` carries out whatever needs no agent's brief."""
        self._host = host
        self._run = run
        self._plain = plain

    def __call__(self, finding: Finding, repair: Repair) -> Done:
        """Do it once; what a child that was killed has left in service is settled before anybody looks again."""
        made = self._made(finding, repair)
        if made.untold and repair in LEAVING:
            self._run("settle", {"host": self._host}, SETTLE_SECONDS)
        return made

    def _made(self, finding: Finding, repair: Repair) -> Done:
        if repair not in SECONDS:
            return self._plain(finding, repair)
        brief = finding.data.get("brief")
        given: Mapping[str, Any] = brief if isinstance(brief, Mapping) else {}
        result = self._run(repair.value, {"host": self._host, **given}, SECONDS[repair])
        report = result.get("report")
        return replace(done(result), report=report if isinstance(report, Mapping) else None)
