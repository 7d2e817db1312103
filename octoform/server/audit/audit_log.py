"""The audit log: what was allowed, refused, approved and stopped, so that a change to it afterwards is noticed.

Append-only JSON lines. Each record carries the hash of the one before it, and a seal beside the log holds the last
one, so a record that was changed, removed, added, moved or cut off shows (``chain`` holds the rule and the check). A
witness in another folder holds the same as the seal, so that log and seal cannot go together unnoticed.

Records are one write to a descriptor opened for appending. Several processes may write (an emergency stop while the
endpoint hangs): each takes the file's lock for its write and goes on from the record that it finds last.
"""

import hashlib
import json
import os
import re
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from octoform.base import clock, locks
from octoform.base.files import make_way, move, private_folder

from .chain import LOG, MAX_LINE, ORIGIN, RECORD, SEAL, SEAL_BYTES, Verdict, rule, sealed, verify

# A file that stays open for long, and is looked at before each use whether its number still means it.
#
# Tools run in this process. One that closes a descriptor twice closes whatever has got that number since, and the next
# device that is opened gets it: a record of the log would then be a command to the device. Standard library only.


class OwnFile:
    """An open file of ours; ``number`` is its descriptor, to be used only after `held` returned true."""

    __slots__ = ("_identity", "number")

    def __init__(self, path: Path, how: int) -> None:
        """Open ``path``, made if it is not there, private; OSError when that cannot be.

        What is in its place and is no file (a link, a pipe, a folder) is renamed: a log or a seal that went away
        shows in the chain, and without a log nothing that moves could be called any more.
        """
        make_way(path)
        self.number = os.open(path, how | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o600)
        status = os.fstat(self.number)
        self._identity = (status.st_dev, status.st_ino)
        if status.st_mode & 0o077:
            os.fchmod(self.number, 0o600)

    def held(self) -> bool:
        """True while the number is this file's; it costs less than a microsecond."""
        try:
            status = os.fstat(self.number)
        except OSError:
            return False
        return (status.st_dev, status.st_ino) == self._identity

    def close(self) -> None:
        """Let it go; a number that is somebody else's by now is left alone."""
        if self.held():
            os.close(self.number)


__all__ = ["Audit", "AuditFailed", "Verdict", "verify"]

ROTATE_BYTES = 50_000_000
TEXT_CHARS, ITEMS, DEPTH, LINE_BYTES = 200, 16, 3, 16_000

_LOCK_SECONDS = 1.0
_SECRET = re.compile(r"passw|passphrase|secret|token|credential|api_?key|private_?key|authorization|\bpin\b", re.I)
_encode = json.JSONEncoder(ensure_ascii=True, separators=(",", ":"), allow_nan=False).encode
_RESERVED = frozenset({"seq", "time", "event", "prev", "hash"})


class AuditFailed(OSError):
    """A record could not be written. The event must not happen unrecorded: the caller decides."""


class Audit:
    """An open log. Made with ``Audit.open``; safe to use from threads."""

    def __init__(self, folder: Path, rotate_bytes: int, witness: Path | None) -> None:
        self._folder = folder
        self._path = folder / LOG
        self._rotate_bytes = rotate_bytes
        self._lock = threading.Lock()
        self._log: OwnFile | None = None
        self._seals: dict[Path, OwnFile] = {}
        self._sealed_at = [folder / SEAL] if witness is None else [folder / SEAL, witness]
        self._open = False
        self._size = -1
        self._seq, self._hash = 0, ORIGIN

    @classmethod
    def open(cls, folder: Path, rotate_bytes: int = ROTATE_BYTES, witness: Path | None = None) -> "Audit":
        """The log in this folder, made if it is not there; AuditFailed when it cannot be opened or read.

        ``witness`` is a file elsewhere that keeps number and hash of the last record, as the seal does.
        """
        audit = cls(folder, rotate_bytes, witness)
        try:
            for path in audit._sealed_at:
                private_folder(path.parent)
            audit._open = True
            audit._enter()
            try:
                audit._begin()
            finally:
                audit._leave()
        except OSError as problem:
            audit.close()
            raise _failed(folder / LOG, problem) from problem
        return audit

    def _begin(self) -> None:
        seal = self._sealed(self._sealed_at[0])
        self._go_on()
        if self._seq and seal is None:
            self._append([("audit_seal_lost", {})])
        self._stamp()

    @property
    def head(self) -> tuple[int, str]:
        """Number and hash of the last record that this object knows; 0 and zeros before the first."""
        return self._seq, self._hash

    def write(self, event: str, **fields: Any) -> str:
        """Append a record and give back its hash; AuditFailed when it is not on the log.

        Fields are bounded: long text is cut, deep or long collections are abridged, values of arguments whose names
        speak of secrets are omitted. Any text passes, whatever characters it has.
        """
        return self.write_all([(event, fields)])

    def write_all(self, records: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
        """`write` several records, events with their fields, as one write: all of them are on the log, or none."""
        bounded = []
        for event, fields in records:
            if not _RESERVED.isdisjoint(fields):
                raise ValueError(f"an audit record has its own {', '.join(sorted(_RESERVED & fields.keys()))}")
            bounded.append((event, {name: _bounded(value, DEPTH) for name, value in fields.items()}))
        if not self._open:
            raise AuditFailed(f"{self._path}: the log is closed")
        with self._lock:
            try:
                self._enter()
                try:
                    return self._record(bounded)
                finally:
                    self._leave()
            except OSError as problem:
                raise _failed(self._path, problem) from problem

    def close(self) -> None:
        """Put log and seal on the disk and let go of them; the log can be opened again."""
        with self._lock:
            for file in (self._log, *self._seals.values()):
                if file is not None and file.held():
                    with suppress(OSError):  # the kernel has the data; no caller is left for an error
                        os.fsync(file.number)
                    file.close()
            self._log, self._open = None, False
            self._seals.clear()

    def _record(self, records: Sequence[tuple[str, Mapping[str, Any]]]) -> str:
        status = os.fstat(self._file)
        if status.st_size != self._size or not status.st_nlink:
            self._go_on()
        if self._size >= self._rotate_bytes:
            self._rotate()
        self._append(records)
        self._stamp()
        return self._hash

    def _enter(self) -> None:
        """Take the lock of the file that is the log now."""
        if self._log is not None and self._log.held():
            self._take(self._log.number)
        else:
            self._reopen()

    def _leave(self) -> None:
        if self._log is not None and self._log.held():
            locks.release(self._log.number)

    @property
    def _file(self) -> int:
        """The log's descriptor, after a look whether it is still the log's; AuditFailed when it is not."""
        if self._log is None or not self._log.held():
            raise AuditFailed(f"{self._path}: something else in this process took the log's descriptor away")
        return self._log.number

    def _sealing(self, path: Path) -> int:
        """A seal's descriptor, opened again when something took it away."""
        seal = self._seals.get(path)
        if seal is None or not seal.held():
            seal = self._seals[path] = OwnFile(path, os.O_RDWR)
        return seal.number

    def _sealed(self, path: Path) -> tuple[int, str] | None:
        return sealed(os.pread(self._sealing(path), SEAL_BYTES, 0))

    def _take(self, descriptor: int) -> None:
        """Bounded, so that a process that was halted while it held the lock cannot hang this one."""
        if not locks.acquire(descriptor, _LOCK_SECONDS):
            raise AuditFailed(f"{self._path}: another process holds the log and does not let go")

    def _append(self, records: Sequence[tuple[str, Mapping[str, Any]]], before: bytes = b"") -> None:
        """Records as one write. A write that the disk took only in part is taken back."""
        seq, digest, text = self._seq, self._hash, ""
        for event, fields in records:
            seq += 1
            body = self._body(seq, event, fields)
            prev, digest = digest, rule(digest.encode("ascii"), body.encode("ascii"))
            text += f'{body},"prev":"{prev}","hash":"{digest}"}}\n'
        lines = before + text.encode("ascii")
        size, written = self._size, -1
        try:
            written = os.write(self._file, lines)
        finally:
            if written != len(lines):
                self._size = -1  # look again before the next record
                with suppress(OSError):  # a fragment that stays is closed off by the next record
                    os.ftruncate(self._file, size)
        if written != len(lines):
            raise AuditFailed(f"{self._path}: the disk took only {written} of {len(lines)} bytes of a record")
        self._size = size + written
        self._seq, self._hash = seq, digest

    def _body(self, seq: int, event: str, fields: Mapping[str, Any]) -> str:
        """A record without its end: the text that the rule of the hash is about."""
        body = _encode({"seq": seq, "time": self._now(), "event": event, **fields})
        if len(body) > LINE_BYTES:
            kept = {name: value for name, value in fields.items() if len(_encode(value)) <= TEXT_CHARS}
            body = _encode({"seq": seq, "time": self._now(), "event": event, **kept, "abridged": True})
        return body[:-1]

    def _stamp(self) -> None:
        """Seal the last record: in place, always the same length, so that it costs no more than a write."""
        text = f'{{"format":1,"seq":{self._seq},"hash":"{self._hash}"}}'
        line = f"{text:<{SEAL_BYTES - 1}}\n".encode("ascii")
        for path in self._sealed_at:
            os.pwrite(self._sealing(path), line, 0)

    def _go_on(self) -> None:
        """Find the last record: at the start, and when another process wrote, rotated or did worse.

        Never goes back behind what is known or sealed: a log that lost records gets a gap that verifying shows.
        """
        known = [(self._seq, self._hash)]
        deadline = time.monotonic() + _LOCK_SECONDS
        while True:
            status = os.fstat(self._file)
            seq, digest, fragment, rotated = _last(self._file, status.st_size)
            known.append((seq, digest))
            if status.st_nlink and not rotated:
                break
            if time.monotonic() >= deadline:
                raise AuditFailed(f"{self._path}: it is rotated again and again before it can be written")
            self._reopen()
        known += [
            self._sealed(path) or (0, ORIGIN) for path in self._sealed_at
        ]  # with the lock of the file that is the log now
        self._size = status.st_size
        self._seq, self._hash = max(known, key=lambda each: each[0])
        if fragment:
            fields = {"bytes": len(fragment), "sha256": hashlib.sha256(fragment).hexdigest()}
            self._append([("audit_torn", fields)], before=b"\n")

    def _rotate(self) -> None:
        """Rename the full file to the number of its first record; the chain goes on in a new one."""
        first = RECORD.match(os.pread(self._file, 2 * LINE_BYTES, 0))
        aside = self._folder / f"audit-{int(first['seq']) if first else self._seq:015d}.jsonl"
        self._append([("audit_rotated", {"file": aside.name})])
        self._stamp()  # before the new file can be seen: a process that opens only that one goes on from the seal
        os.fsync(self._file)
        move(self._path, aside)
        self._reopen()
        self._go_on()

    def _reopen(self) -> None:
        """The file that bears the log's name now, with its lock; the lock of the former one is given up first."""
        if self._log is not None:
            self._log.close()
        self._log = None
        fresh = OwnFile(self._path, os.O_RDWR | os.O_APPEND)
        try:
            self._take(fresh.number)
        except OSError:
            fresh.close()
            raise
        self._log, self._size = fresh, -1

    def _now(self) -> str:
        return clock.stamp(digits=3)


def _last(log: int, size: int) -> tuple[int, str, bytes, bool]:
    """Number and hash of the last whole record, what is behind it, and whether it states that the file is done."""
    lines = os.pread(log, MAX_LINE, max(0, size - MAX_LINE)).split(b"\n")
    fragment = lines.pop()
    for line in reversed(lines):
        if found := RECORD.fullmatch(line + b"\n"):
            return int(found["seq"]), found["hash"].decode("ascii"), fragment, found["event"] == b"audit_rotated"
    return 0, ORIGIN, fragment, False


def _failed(path: Path, problem: OSError) -> AuditFailed:
    """The error for a refusal of the operating system, with the file's name."""
    if isinstance(problem, AuditFailed):
        return problem
    return AuditFailed(f"{path}: the audit log cannot be written: {problem.strerror or problem}")


def _bounded(value: Any, depth: int) -> Any:
    kind = type(value)
    if kind is str:
        return value if len(value) <= TEXT_CHARS else _cut(value)
    if value is None or kind is bool:
        return value
    if kind is int:
        return value if value.bit_length() <= 64 else f"an integer of {value.bit_length()} bits"
    if kind is float:
        return value if value - value == 0 else str(value)
    if isinstance(value, Mapping):
        return _mapping(value, depth)
    if isinstance(value, list | tuple):
        kept = [_bounded(item, depth - 1) for item in value[:ITEMS]] if depth else []
        return kept if len(kept) == len(value) else [*kept, f"... ({len(value)} items)"]
    return _cut(f"<{kind.__name__}>")


def _mapping(value: Mapping[Any, Any], depth: int) -> dict[str, Any]:
    kept: dict[str, Any] = {}
    for name, item in value.items():
        if not depth or len(kept) == ITEMS:
            kept["..."] = f"{len(value)} items"
            break
        text = _cut(str(name))
        kept[text] = "(omitted)" if _secret(text) else _bounded(item, depth - 1)
    return kept


def _cut(text: str) -> str:
    return text if len(text) <= TEXT_CHARS else f"{text[:TEXT_CHARS]}... ({len(text)} characters)"


@lru_cache(maxsize=1024)
def _secret(name: str) -> bool:
    return _SECRET.search(name) is not None
