"""The loop's `Repairer`: which job each repair is, what it is given, and how long it may take. Light.

Everything runs in a child of the daemon, also what is light: a child that hangs is ended, and the daemon is not. A
restart is the exception where the daemon makes it itself: it is bounded in all of its steps, and anyone who waits for
the endpoint does not wait for the start of a child as well.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from octoform.daemon.model import Done, Finding, Kind, Repair, Repairer, Spent
from octoform.records import dataclass

Run = Callable[[str, Mapping[str, Any], float], Mapping[str, Any]]
"""Does a job in a child: name, brief, seconds; `octoform.daemon.repair.worker_port.Workers.run`."""


Restart = Callable[[bool], Done]
"""Starts the endpoint again; True for a process that hangs."""


@dataclass(frozen=True, slots=True)
class Work:
    """A job by its name, and the seconds that it may take."""

    job: str
    seconds: float


_WORK = {
    Repair.RESTART: Work("restart", 150.0),
    Repair.RESTORE: Work("restore", 90.0),
    Repair.REPUBLISH: Work("republish", 240.0),
    Repair.REBUILD: Work("rebuild", 720.0),
    Repair.REBIND: Work("rebind", 90.0),
    Repair.ROTATE: Work("rotate", 120.0),
    Repair.REDISCOVER: Work("rediscover", 3600.0),
}
_FREE = Work("free", 120.0)


class Repairs:
    """Carries out repairs for one host. ``apply`` is the manifest's ``daemon.apply``: ``auto`` or ``ask``.

    ``restart`` starts the endpoint in the thread that asks for it; None: in a child, as all the rest.
    """

    def __init__(self, host: str, run: Run, apply: str = "auto", restart: Restart | None = None) -> None:
        self._restart = restart
        self._host = host
        self._run = run
        self._apply = apply

    def __call__(self, finding: Finding, repair: Repair) -> Done:
        """Do it once; what needs an agent's brief (WATCH, HEAL) and what is no one's work is not done here."""
        if repair is Repair.RESTART and self._restart is not None:
            return self._restart(finding.kind is Kind.PROCESS_HUNG)
        work = _FREE if _frees(finding, repair) else _WORK.get(repair)
        if work is None:
            return Done(False, f"{repair} is no repair that can be carried out by itself", again=False)
        return done(self._run(work.job, {"host": self._host, **self._brief(finding, repair)}, work.seconds))

    def _brief(self, finding: Finding, repair: Repair) -> dict[str, Any]:
        name = finding.target.partition(":")[2]
        if repair is Repair.RESTART:
            return {"hung": finding.kind is Kind.PROCESS_HUNG}
        if repair is Repair.REBIND:
            return {"device": name}
        if repair is Repair.ROTATE and not _frees(finding, repair):
            return {"log": name}
        return {**finding.data.get("brief", {}), "apply": self._apply} if repair is Repair.REDISCOVER else {}


def _frees(finding: Finding, repair: Repair) -> bool:
    return finding.kind is Kind.DISK_FULL and repair is Repair.ROTATE


def done(result: Mapping[str, Any]) -> Done:
    """A job's result in the loop's form; a result without ``ok`` is a failure."""
    spent = result.get("spent")
    known = spent if isinstance(spent, Mapping) else {}
    usd = known.get("usd", 0.0)
    return Done(
        ok=result.get("ok") is True,
        detail=str(result.get("detail") or ""),
        again=result.get("again") is not False,
        spent=Spent(
            calls=int(known.get("calls") or 0),
            input_tokens=int(known.get("input_tokens") or 0),
            output_tokens=int(known.get("output_tokens") or 0),
            usd=None if usd is None else float(usd),
        ),
        untold=result.get("untold") is True,
        asked=result.get("asked") is True,
    )


# WATCH, HEAL and ROLL_BACK as the loop's repairs: the brief goes to a child, the report comes back. Light.

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
