"""Chooses the fix of one error by the playbook alone: the action of its class; code is not rewritten."""

from collections.abc import Mapping
from typing import Any

from octoform.builtin.task import Task, TaskRefused

# The duty: one error in, the one action of its class out.
#
# The embedded agent writes its servers from rules, so there is nothing that it would write otherwise: an error in the
# code of a tool is honestly handed to a person. All other classes are repaired without a look at the code.

_ACTIONS = {
    "dependency": ("redeploy", "a library of the serving environment is missing or does not load"),
    "corrupted_file": ("restore", "a file that belongs to the server can no longer be read as what it was accepted as"),
    "dead_process": ("restart", "the server does not run or answer"),
    "device_moved": ("rediscover", "a device is attached, and is not where it was looked for"),
}
_NO_REWRITE = (
    "the code of the tool seems to be wrong, and the embedded agent rewrites no code: a model or a person must"
)
_NOT_MINE = "no repair of the playbook fixes this: a person is needed"
MAX_CITES = 16


def run(task: Task) -> str:
    """Write the report; the summary line (``repaired by redeploy``)."""
    try:
        report = answer(task.read_input())
    except (KeyError, TypeError, AttributeError) as problem:
        raise TaskRefused(f"the input of HEAL cannot be used: {type(problem).__name__}: {problem}") from problem
    task.write(report)
    return f"{report['status']} by {report['action']}"


def answer(document: Mapping[str, Any]) -> dict[str, Any]:
    """The report for an input."""
    error = document["error"]
    kind, cites = error["class"], _cites(document)
    action, reason = _ACTIONS.get(kind, ("none", _NO_REWRITE if kind == "broken_tool" else _NOT_MINE))
    status = "repaired" if action != "none" else "failed" if kind == "broken_tool" else "not_mine"
    if action != "none" and not cites:
        action, status, reason = "none", "failed", "nothing that was given shows the error, so nothing is done about it"
    return {
        "format": 1,
        "stage": "heal",
        "class": kind,
        "target": document["target"],
        "status": status,
        "reason": reason,
        "action": action,
        "functions": [],
        "server": None,
        "cites": cites,
        "claims": [],
    }


def _cites(document: Mapping[str, Any]) -> list[str]:
    """The evidence for the error, as far as it was given."""
    known = {row["id"] for part in ("readings", "failures") for row in document.get(part, [])}
    return [identity for identity in document["error"].get("cites", []) if identity in known][:MAX_CITES]


__all__ = ["run"]
