"""The audit log as a person asks for it: its latest records, and whether it is as it was written. Light.

The rule of its hash is the launcher's; checking runs the launcher's own program.
"""

from collections.abc import Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from octoform.base.clock import parse_stamp
from octoform.base.files import parse, stream
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.process import offline_commands
from octoform.records import dataclass
from octoform.state.layout import Layout

LOG = "audit.jsonl"
_BLOCK = 256 * 1024
Record = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Checked:
    """The result of checking the whole log. ``hash`` is that of the last record, ``seq``: with a copy of it, a reader
    can prove later that the log up to there is the same. ``line`` of ``file`` is where the first of ``faults`` is."""

    ok: bool
    records: int
    seq: int
    hash: str
    faults: int
    problem: str
    file: Path
    line: int
    note: str


@dataclass(frozen=True, slots=True)
class Wanted:
    """Which records are looked for; nothing set means all.

    ``tool`` is the exact name, ``client`` a part of what the client calls itself, of its token's name, or its process
    number, ``since`` the earliest moment, ``refused`` only what was not allowed.
    """

    tool: str | None = None
    client: str | None = None
    since: datetime | None = None
    refused: bool = False

    def takes(self, record: Record) -> bool:
        """Whether the record is looked for; an outcome does not name its client (see `latest`)."""
        by_tool = self.tool is None or record.get("tool") == self.tool
        by_client = self.client is None or self._from(record)
        return by_tool and by_client and (not self.refused or record.get("decision") == "refuse")

    def over(self, record: Record) -> bool:
        """Whether the record, and every one before it, is too old."""
        if self.since is None:
            return False
        moment = parse_stamp(record.get("time"), zone=None)  # none, or one without a zone, is not known to be too old
        return moment is not None and moment.tzinfo is not None and moment < self.since

    def _from(self, record: Record) -> bool:
        part = (self.client or "").casefold()
        text = f"{record.get('client') or ''}\n{record.get('caller') or ''}".casefold()
        return "decision" in record and (part in text or part == str(record.get("pid")))


ALL = Wanted()


def latest(layout: Layout, count: int, wanted: Wanted = ALL) -> tuple[list[Record], list[Diagnostic]]:
    """Up to ``count`` of the wanted records, the latest last; lines that are no record are omitted.

    With a client, what came of its calls belongs to them, and does not count.
    """
    found: list[Record] = []
    outcomes: dict[str, list[Record]] = {}
    left = count
    try:
        for record in _backwards(layout.logs):
            if left <= 0 or wanted.over(record):
                break
            if wanted.takes(record):
                found += [*(outcomes.pop(str(record.get("call")), ())), record]
                left -= 1
            elif wanted.client is not None and not wanted.refused and record.get("call"):
                outcomes.setdefault(str(record["call"]), []).append(record)
    except OSError as problem:
        return [], [_unreadable(Path(problem.filename or layout.logs), problem.strerror or str(problem))]
    return sorted(found, key=lambda record: _number(record.get("seq"))), []


def verify(layout: Layout) -> tuple[Checked | None, list[Diagnostic]]:
    """Check every record; AUDIT-BROKEN with the first place where something was done to the log."""
    answer = offline_commands.verify(layout)
    if "records" not in answer:
        return None, [_unreadable(layout.logs, "; ".join(map(str, answer["problems"])))]
    checked = Checked(**{**answer, "file": layout.logs / (answer["file"] or LOG)})
    if checked.ok:
        return checked, []
    more = "" if checked.faults == 1 else f"{checked.faults - 1} more places do not fit either"
    hint = "octoform explain AUDIT-BROKEN lists possible causes; keep the files as they are"
    where = f"{checked.file}:{checked.line}"
    return checked, [error("AUDIT-BROKEN", checked.problem, detail=more, path=where, hint=hint)]


def _unreadable(path: Path, reason: str) -> Diagnostic:
    return error("AUDIT-UNREADABLE", f"the audit log cannot be read: {reason}", path=str(path))


def _files(folder: Path) -> list[Path]:
    """The logs, the newest first."""
    aside = sorted(folder.glob("audit-*.jsonl"), reverse=True)
    return [folder / LOG, *aside] if (folder / LOG).exists() else aside


def _backwards(folder: Path) -> Iterator[Record]:
    """The records of all logs, the newest first; only so much is read as is asked for."""
    for path in _files(folder):
        with stream(path) as log:
            position, rest = log.seek(0, 2), b""
            while position:
                step = min(_BLOCK, position)
                position -= step
                log.seek(position)
                first, *lines = (log.read(step) + rest).split(b"\n")
                rest = first
                yield from filter(None, map(_parsed, reversed(lines)))
            if (record := _parsed(rest)) is not None:
                yield record


def _number(value: object) -> int:
    return value if isinstance(value, int) else 0


def _parsed(line: bytes) -> Record | None:
    try:
        value = parse(line)
    except ValueError:
        return None
    return value if isinstance(value, dict) and "event" in value else None
