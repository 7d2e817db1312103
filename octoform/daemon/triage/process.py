"""The endpoint's process: gone, silent, or ending again and again."""

from collections.abc import Iterable, Iterator, Mapping

from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair, Status
from octoform.daemon.triage.failure_history import Recall
from octoform.escaping import escaped

CRASHES = 3
"""Short lives in the window after which it is a loop, and another start alone no repair."""
TARGET = "endpoint"
THE_START = "the start"
"""Who said it, of a finding that is made of the words of a start that failed."""
_BARRED = frozenset({Repair.RESTORE, Repair.REBUILD, Repair.REPUBLISH})


def judged(facts: Facts, recall: Recall, standing: Iterable[Finding]) -> Iterator[Finding]:
    """At most one finding about the process; none while a person wants it stopped.

    ``standing`` is what is wrong with what it stands on: as long as that bars a start, none is tried.
    """
    if facts.stopped_by is not None:
        return
    if facts.process is None:
        if not any(map(_bars, standing)):
            yield _gone(facts, recall)
    elif facts.answers is False:
        summary = "the endpoint's process does not answer"
        then = (Repair.RESTART, Repair.REBUILD)
        fault = FaultClass.DEAD_PROCESS
        yield Finding(
            Kind.PROCESS_HUNG, fault, TARGET, summary, ("silent",), Repair.RESTART, then, Status.DOWN, _said(facts)
        )
    else:
        yield from _stuck(facts)


def tunnel(facts: Facts) -> Iterator[Finding]:
    """A tunnel that ought to run and does not; its own process opens it again, so it is only said."""
    told = (facts.told or {}).get("tunnel")
    if isinstance(told, Mapping) and told.get("state") not in ("running", "starting", "revoked"):
        yield Finding(
            Kind.TUNNEL_DOWN,
            FaultClass.NONE,
            "tunnel",
            "the tunnel does not run: the endpoint cannot be reached from the internet",
            ("down",),
            Repair.WAIT,
            detail=escaped(str(told.get("reason") or ""))[:400],
        )


def _bars(finding: Finding) -> bool:
    """Whether a start must wait until this is repaired; what only a failed start said is proved by the next start."""
    return finding.kind is Kind.PORT_TAKEN or (finding.repair in _BARRED and finding.data.get("who") != THE_START)


def _gone(facts: Facts, recall: Recall) -> Finding:
    if len(recall.ends) >= CRASHES:
        summary = f"the endpoint's process ended {len(recall.ends)} times soon after its start"
        kind, evidence, first, then = Kind.CRASH_LOOP, ("crash loop",), Repair.REBUILD, (Repair.RESTART, Repair.PERSON)
    else:
        summary, kind = "the endpoint's process is gone", Kind.PROCESS_DEAD
        evidence, first, then = ("gone",), Repair.RESTART, (Repair.RESTART, Repair.REBUILD)
    return Finding(kind, FaultClass.DEAD_PROCESS, TARGET, summary, evidence, first, then, Status.DOWN, _said(facts))


def _stuck(facts: Facts) -> Iterator[Finding]:
    """Tools whose code has not ended although their time was over: only another process sets their bus free."""
    gate = (facts.told or {}).get("gate")
    stuck = gate.get("stuck") if isinstance(gate, Mapping) else None
    for name in sorted({_name(each) for each in stuck or ()}):
        yield Finding(
            Kind.PROCESS_HUNG,
            FaultClass.DEAD_PROCESS,
            f"tool:{name}",
            f"{name} has not ended although it was stopped, and holds its device",
            ("stuck", name),
            Repair.RESTART,
            (Repair.WATCH,),
            data={"tool": name},
        )


def _name(stuck: object) -> str:
    return escaped(str(stuck.get("tool", "a tool")) if isinstance(stuck, Mapping) else str(stuck))[:80]


def _said(facts: Facts) -> str:
    """What the process or its last start said, bounded."""
    return escaped(facts.start_failed or "\n".join(facts.printed[-10:]), keep="\n")[:1500]
