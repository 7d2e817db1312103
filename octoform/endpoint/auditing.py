"""The audit log as a person asks for it: its latest records, and whether it is as it was written. Light.

The rule of its hash is the launcher's; checking runs the launcher's own program.
"""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint import offline
from octoform.state.layout import Layout

LOG = "audit.jsonl"
_BLOCK = 256 * 1024


@dataclass(frozen=True, slots=True)
class Checked:
    """What checking the whole log gave. ``hash`` is that of the last record, number ``seq``: whoever keeps it elsewhere
    can tell later that the log up to there is the same. ``line`` of ``file`` is where the first of ``faults`` is."""

    ok: bool
    records: int
    seq: int
    hash: str
    faults: int
    problem: str
    file: Path
    line: int
    note: str


def latest(layout: Layout, count: int) -> tuple[list[dict[str, Any]], list[Diagnostic]]:
    """Up to ``count`` records, the latest last; lines that are none are left out. None where there is no log."""
    found: list[dict[str, Any]] = []
    for path in _files(layout.logs):
        if len(found) >= count:
            break
        try:
            found = [*_tail(path, count - len(found)), *found]
        except OSError as problem:
            return [], [_unreadable(path, problem.strerror or str(problem))]
    return found, []


def verify(layout: Layout) -> tuple[Checked | None, list[Diagnostic]]:
    """Check every record; AUDIT-BROKEN with the first place where something was done to the log."""
    answer = offline.verify(layout)
    if "records" not in answer:
        return None, [_unreadable(layout.logs, "; ".join(map(str, answer["problems"])))]
    checked = Checked(**{**answer, "file": layout.logs / (answer["file"] or LOG)})
    if checked.ok:
        return checked, []
    more = "" if checked.faults == 1 else f"{checked.faults - 1} more places do not fit either"
    hint = "octoform explain AUDIT-BROKEN tells what can have done it; keep the files as they are"
    where = f"{checked.file}:{checked.line}"
    return checked, [error("AUDIT-BROKEN", checked.problem, detail=more, path=where, hint=hint)]


def _unreadable(path: Path, reason: str) -> Diagnostic:
    return error("AUDIT-UNREADABLE", f"the audit log cannot be read: {reason}", path=str(path))


def _files(folder: Path) -> list[Path]:
    """The logs, the newest first."""
    aside = sorted(folder.glob("audit-*.jsonl"), reverse=True)
    return [folder / LOG, *aside] if (folder / LOG).exists() else aside


def _tail(path: Path, count: int) -> list[dict[str, Any]]:
    """The last records of a file; only so much of it is read as is needed."""
    with path.open("rb") as log:
        position, data = log.seek(0, 2), b""
        while position and data.count(b"\n") <= count:
            step = min(_BLOCK, position)
            position -= step
            log.seek(position)
            data = log.read(step) + data
    lines = data.splitlines()[1 if position else 0 :]
    return [record for record in map(_parsed, lines[-count:]) if record is not None] if count else []


def _parsed(line: bytes) -> dict[str, Any] | None:
    try:
        value = json.loads(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) and "event" in value else None
