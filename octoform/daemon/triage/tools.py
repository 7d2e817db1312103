"""Tools that fail for a reason that nothing else explains: the one thing that an agent is asked about.

An exception that says something of the code counts at once; what a device, a line or a client's arguments may have
caused counts when it happens again with no success between.
"""

from collections.abc import Iterable, Iterator

from octoform.daemon.model import Facts, FaultClass, Finding, Kind, Repair
from octoform.daemon.triage.failure_history import ABSENT, AMBIGUOUS, OVERDUE, Failing, Recall
from octoform.endpoint.client.check_verdict import DEFECTS

AGAIN = 2
"""Failures in a row after which one that may be the room's is taken for the tool's."""
BUSY_AGAIN = 5
_BUSY = "BusBusy"
_OF_PERSON = frozenset({"PermissionError"})
_EXPLAINING = frozenset(
    {Kind.DEVICE_GONE, Kind.DEVICE_MOVED, Kind.DEVICE_BACK, Kind.PACKAGE_DAMAGED, Kind.PACKAGE_CONFLICT}
)
_IMPORTS = frozenset({"ModuleNotFoundError", "ImportError"})


def judged(facts: Facts, recall: Recall, others: Iterable[Finding]) -> Iterator[Finding]:
    """A finding for each tool that fails by itself; none while something else that is wrong explains failures."""
    found = list(others)
    held = {str(each.data["tool"]) for each in found if each.kind is Kind.PROCESS_HUNG and "tool" in each.data}
    explained = facts.process is None or any(each.kind in _EXPLAINING for each in found)
    for name, failing in sorted(recall.failing.items()):
        finding = None if name in held else _judged(name, failing, explained)
        if finding is not None:
            yield finding


def _judged(name: str, failing: Failing, explained: bool) -> Finding | None:
    if failing.error in _IMPORTS:
        return None  # told as a package
    if failing.error == AMBIGUOUS:
        return _finding(Kind.DEVICE_DOUBTFUL, FaultClass.DEVICE_MOVED, name, failing, Repair.PERSON)
    if failing.error == ABSENT:
        return None if explained else _finding(Kind.DEVICE_GONE, FaultClass.DEVICE_MOVED, name, failing, Repair.WAIT)
    if failing.error in DEFECTS:
        return _finding(Kind.TOOL_FAILING, FaultClass.BROKEN_TOOL, name, failing, Repair.WATCH)
    least = {_BUSY: BUSY_AGAIN, OVERDUE: 1}.get(failing.error, AGAIN)
    if explained or failing.times < least:
        return None
    if failing.error in _OF_PERSON:
        return _finding(Kind.TOOL_FAILING, FaultClass.NONE, name, failing, Repair.PERSON)
    return _finding(Kind.TOOL_FAILING, FaultClass.NONE, name, failing, Repair.WATCH)


def _finding(kind: Kind, fault: FaultClass, name: str, failing: Failing, repair: Repair) -> Finding:
    summary = f"{name} fails: {failing.error}: {failing.message}"[:300]
    data = {"tool": name, "error": failing.error, "message": failing.message, "times": failing.times}
    evidence = (failing.error, failing.said)
    return Finding(kind, fault, f"tool:{name}", summary, evidence, repair, data=data)
