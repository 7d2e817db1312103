"""What the trial at DEPLOY finds wrong with the server goes back to SERVE, in the same run.

Some faults of generated code show only when its tools are called. No set of packages mends them, so DEPLOY is not tried
again; the agent of SERVE gets the findings and the server that it was accepted with, and then DEPLOY runs once more.
Only a server that was made in this very run is sent back: a run never remakes what its plan did not list.
"""

from collections.abc import Iterable

from octoform.apply.attempt import Failed
from octoform.apply.context import Context
from octoform.diagnostics import Diagnostic, has_errors
from octoform.state.files import read_regular

MOST_RETURNS = 2
MAKER, JUDGE = "serve", "deploy"
SHOWN = frozenset(
    {"ENDPOINT-TOOL-BROKEN", "ENDPOINT-TOOLS-DIFFER", "ENDPOINT-CALL-NOT-LOGGED", "ENDPOINT-OUTPUT-INVALID"}
    | {"ENDPOINT-RESULT-IMPLAUSIBLE", "ENDPOINT-RESULT-OTHER-DEVICE", "ENDPOINT-RESULT-CONSTANT"}
    | {"ENDPOINT-DEVICE-ABSENT", "ENDPOINT-PROGRAM-MISSING", "ENDPOINT-NETWORK-FAILED", "ENDPOINT-NOTHING-ANSWERS"}
)
"""Faults of the server itself, seen when it was started and called."""
TOLD = frozenset({"DEPLOY-STATUS-ERROR"})
"""DEPLOY's agent says that no set of packages works; it may be wrong, so it is asked again first."""


def is_servers_fault(stage: str, found: Iterable[Diagnostic]) -> bool:
    """True when another attempt at the stage cannot help, since the server is at fault."""
    return stage == JUDGE and any(item.code in SHOWN and has_errors([item]) for item in found)


def sent_back(context: Context, failed: str | None, found: Iterable[Diagnostic]) -> Failed | None:
    """What SERVE is told, when it is SERVE that has to mend why the run failed; else None."""
    blamed = tuple(item for item in found if item.code in SHOWN | TOLD and has_errors([item]))
    if failed != JUDGE or not blamed:
        return None
    return Failed((), None, context.specs[MAKER].text, read_regular(context.layout.output(MAKER))[0], blamed)
