"""The write-ahead journal: what was begun and how it ended, one synced line for each step.

A step costs one line and not one snapshot, and a kill between any two lines loses nothing: what began and never ended
can be seen. Each line carries a checksum, so a line is either exactly what was written or no record. The journal is
local; it names the snapshot that it continues, so it is never folded onto another one (a pull, a checkout). Light.
"""

import os
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path

from octoform.base import digest
from octoform.base.files import move, parse, sync_folder, write_all
from octoform.diagnostics import Diagnostic, error, warning
from octoform.records import dataclass
from octoform.state.files import (
    SIZE_LIMIT,
    Checkpoint,
    display,
    pass_by,
    read_regular,
    refused,
)


class Op(StrEnum):
    """The kinds of records. ``head`` and ``commit`` are about snapshots, the others about a node."""

    HEAD = "head"
    BEGIN = "begin"
    SUCCESS = "success"
    FAILURE = "failure"
    DESTROY = "destroy"
    TAINT = "taint"
    NOTE = "note"
    COMMIT = "commit"


@dataclass(frozen=True, slots=True)
class Record:
    """One line. ``n`` grows by one in a file, ``time`` is RFC 3339, ``run`` identifies the process that wrote."""

    n: int
    time: str
    op: Op
    run: str
    node: str
    data: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Reading:
    """A whole journal: its records, how many bytes they take, and whether half a line follows them."""

    records: tuple[Record, ...] = ()
    length: int = 0
    torn: bool = False


def encode(record: Record) -> bytes:
    """The line of a record, with its checksum and line end."""
    body = _body(record)
    body["sum"] = _checksum(body)
    return digest.canonical_json(body) + b"\n"


def _body(record: Record) -> dict[str, object]:
    return {
        "n": record.n,
        "time": record.time,
        "op": record.op.value,
        "run": record.run,
        "node": record.node,
        "data": dict(record.data),
    }


def _checksum(body: Mapping[str, object]) -> str:
    return digest.short(digest.of_value(body))


def decode(line: bytes) -> Record | None:
    """The record on a line (without its line end), or None when it is not exactly what was written."""
    try:
        body = parse(line)
        checksum = body.pop("sum")
        if checksum != _checksum(body):
            return None
        data = body["data"]
        return Record(body["n"], body["time"], Op(body["op"]), body["run"], body["node"], data)
    except (ValueError, TypeError, KeyError, AttributeError):
        return None


def read(path: Path) -> tuple[Reading | None, list[Diagnostic]]:
    """All records of a journal; an absent file is an empty one.

    Half a line at the end was never acknowledged to anybody: it is ignored with a warning (STATE-JOURNAL-TORN). A bad
    line elsewhere is an error (STATE-JOURNAL-CORRUPT).
    """
    data, problem = read_regular(path, SIZE_LIMIT)
    if problem is not None:
        return None, [problem]
    if not data:
        return Reading(), []
    complete, newline, tail = data.rpartition(b"\n")
    lines = complete.split(b"\n") if newline else []
    records = []
    for number, line in enumerate(lines, start=1):
        record = decode(line)
        if record is None or record.n != number:
            return None, [_corrupt(path, number, len(lines))]
        records.append(record)
    reading = Reading(tuple(records), len(complete) + len(newline), bool(tail))
    return reading, [_torn(path, len(lines) + 1)] if tail else []


def _corrupt(path: Path, number: int, lines: int) -> Diagnostic:
    return error(
        "STATE-JOURNAL-CORRUPT",
        f"line {number} of {lines} of the journal is not what octoform wrote there",
        path=display(path),
        detail=f"lines 1 to {number - 1} are whole; the snapshot that the journal continues is not touched",
        hint="move the journal away to go on from the snapshot; what was accepted after it is verified or made again",
    )


def _torn(path: Path, number: int) -> Diagnostic:
    return warning(
        "STATE-JOURNAL-TORN",
        f"line {number} of the journal was cut while it was written; it is ignored",
        path=display(path),
        hint="nothing to do: its step counts as interrupted",
    )


class Journal:
    """Appends to one journal file. The caller holds the lock."""

    def __init__(self, path: Path, reading: Reading, checkpoint: Checkpoint = pass_by) -> None:
        """``reading`` is what `read` found; half a line at the end is cut off by the first append."""
        self._path = path
        self._length = reading.length
        self._count = len(reading.records)
        self._checkpoint = checkpoint

    @property
    def count(self) -> int:
        """How many records the file has."""
        return self._count

    def append(self, record: Record) -> Diagnostic | None:
        """Write one record to the disk; None when it is durable, else the file is as it was before.

        Checkpoints: ``journal.<op>.start``, ``journal.<op>.written``, ``journal.<op>.synced``.
        """
        name = f"journal.{record.op.value}"
        line = encode(record)
        try:
            self._checkpoint(f"{name}.start")
            self._write(line, name)
        except OSError as problem:
            return refused(problem, self._path)
        self._length += len(line)
        self._count += 1
        self._checkpoint(f"{name}.synced")
        return None

    def _write(self, line: bytes, name: str) -> None:
        flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
        descriptor = os.open(self._path, flags, 0o600)
        try:
            os.ftruncate(descriptor, self._length)
            try:
                write_all(descriptor, line)
                self._checkpoint(f"{name}.written")
                os.fsync(descriptor)
            except OSError:
                os.ftruncate(descriptor, self._length)
                raise
        finally:
            os.close(descriptor)
        if self._count == 0:
            sync_folder(self._path.parent)

    def clear(self) -> Diagnostic | None:
        """Drop the records once a snapshot has absorbed them. Checkpoint: ``journal.cleared``."""
        return self._gone(None)

    def set_aside(self, target: Path) -> Diagnostic | None:
        """Move the file away, for a person to look at, and start an empty one."""
        return self._gone(target)

    def _gone(self, target: Path | None) -> Diagnostic | None:
        try:
            if not self._path.exists():
                return None
            if target is None:
                self._path.unlink()
            else:
                move(self._path, target)
            self._length = self._count = 0
            sync_folder(self._path.parent)
        except OSError as problem:
            return refused(problem, self._path)
        self._checkpoint("journal.cleared")
        return None
