"""The chain of the audit log: the one rule of its hash, and the check that every record is as it was written.

Alone in a file that imports nothing of the launcher, so that it is a program as well: ``python -I chain.py verify
FOLDER [WITNESS]``. The process writes by this rule, a person who doubts the log checks by it, and no second copy
exists.

A record is one line: ``{"seq":...,"time":...,"event":...,...,"prev":"<hash>","hash":"<hash>"}``. Its hash is sha256
over the hash of the record before it and its own bytes up to where ``prev`` begins.
"""

import errno
import hashlib
import json
import os
import re
import stat
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

LOG, SEAL = "audit.jsonl", "audit.head"
ORIGIN = "0" * 64
SEAL_BYTES = 128
MAX_LINE = 64_000
RECORD = re.compile(
    rb'(?P<body>\{"seq":(?P<seq>\d{1,15}),"time":"[^"]*","event":"(?P<event>[^"]*)".*)'
    rb',"prev":"(?P<prev>[0-9a-f]{64})","hash":"(?P<hash>[0-9a-f]{64})"\}\n'
)
_TORN = re.compile(rb'"event":"audit_torn","bytes":(\d+),"sha256":"([0-9a-f]{64})"')


@dataclass(frozen=True, slots=True)
class Verdict:
    """The result of ``verify``. ``line`` is that of ``file`` where the first thing is wrong; ``note`` is no fault."""

    ok: bool
    records: int
    seq: int
    hash: str
    faults: int = 0
    problem: str = ""
    file: str = ""
    line: int = 0
    note: str = ""


def verify(folder: Path, witness: Path | None = None) -> Verdict:
    """Check every record of a folder's logs, the oldest first, and the last one against the seal. Changes nothing.

    ``witness`` is a seal in another folder: it shows that log and seal went away together, or were put back older; that
    there is none shows nothing. May run while the log is written. OSError when a file cannot be read.
    """
    while True:
        names = _files(folder)
        try:
            verdict = _Check(folder, witness).all(names)
        except FileNotFoundError:
            if names == _files(folder):
                raise
            continue  # the log was rotated meanwhile
        if verdict.ok or names == _files(folder):  # otherwise it was, too
            return verdict


class _Check:
    """One run over all records; goes on after a fault with what the faulty record states, to count further ones."""

    def __init__(self, folder: Path, witness: Path | None) -> None:
        self._folder = folder
        self._seal = _seal_at(folder / SEAL)
        self._witness = None if witness is None else _seal_at(witness)
        self._records = self._seq = self._line = 0
        self._hash, self._file, self._note = ORIGIN, LOG, ""
        self._unreadable: tuple[str, int, bytes] | None = None
        self._fault: tuple[str, str, int] | None = None
        self._faults = 0

    def all(self, names: list[str]) -> Verdict:
        for name in names:
            self._file, self._line = name, 0
            with open(self._folder / name, "rb", opener=_at_once) as log:
                while line := log.readline(MAX_LINE):
                    self._line += 1
                    self._one(line)
        self._end(bool(names))
        text, file, number = self._fault or ("", "", 0)
        return Verdict(
            not self._faults, self._records, self._seq, self._hash, self._faults, text, file, number, self._note
        )

    def _one(self, line: bytes) -> None:
        found = RECORD.fullmatch(line)
        self._settle(found)
        if found is None:
            self._unreadable = (self._file, self._line, line)
            return
        number, prev, digest = int(found["seq"]), found["prev"], found["hash"].decode("ascii")
        if rule(prev, found["body"]) != digest:
            self._wrong(f"record {number} was changed")
        elif number != self._seq + 1 or prev != self._hash.encode("ascii"):
            self._wrong(self._misplaced(number))
        elif any(seal and number == seal[0] and digest != seal[1] for seal in (self._seal, self._witness)):
            self._wrong(f"record {number} is not the one that was sealed: the log was written again")
        elif found["event"] == b"audit_seal_lost":
            self._wrong(f"the seal was missing when record {number} was written: the end may have been cut off before")
        self._records, self._seq, self._hash = self._records + 1, number, digest

    def _misplaced(self, number: int) -> str:
        expected = self._seq + 1
        if number == expected:
            return f"record {number} does not follow from the one before it: record {number - 1} was changed"
        if number < expected:
            return f"record {number} comes after record {self._seq}: it was moved or added"
        gap = f"record {expected}" if number == expected + 1 else f"records {expected} to {number - 1}"
        return f"{gap} before record {number} went missing: removed or moved"

    def _settle(self, following: "re.Match[bytes] | None") -> None:
        """A line that is no record is a fault, unless the next record states that it closed off just this fragment."""
        if self._unreadable is None:
            return
        file, number, line = self._unreadable
        self._unreadable = None
        is_known = following is not None and following["event"] == b"audit_torn"
        torn = _TORN.search(following["body"]) if following and is_known else None
        fragment = line[:-1]
        if torn is None or (int(torn[1]), torn[2].decode()) != (len(fragment), hashlib.sha256(fragment).hexdigest()):
            self._wrong("this line is no record: it was changed or added", file, number)

    def _end(self, any_file: bool) -> None:
        if self._unreadable is not None and not self._unreadable[2].endswith(b"\n"):
            self._unreadable = None
            self._note = "the last line is incomplete: it is being written, or the process ended while it wrote"
        self._settle(None)
        if self._seal is None and any_file:
            self._wrong(f"the seal {SEAL} is missing or damaged: whether the end was cut off is unknown", SEAL, 1)
        elif self._seal is not None and self._seal[0] > self._seq:
            self._cut(self._seal[0], "cut off")
        elif self._witness is not None and self._witness[0] > self._seq:
            self._cut(self._witness[0], "log and seal were taken away together, or older ones put in their place")
        elif not self._records:
            self._note = "nothing was recorded yet"

    def _cut(self, last: int, how: str) -> None:
        gap = f"record {last}" if last == self._seq + 1 else f"records {self._seq + 1} to {last}"
        self._wrong(f"{gap} went missing at the end: {how}", self._file, self._line + (0 if self._note else 1))

    def _wrong(self, text: str, file: str = "", line: int = 0) -> None:
        self._faults += 1
        self._fault = self._fault or (text, file or self._file, line or self._line)


def rule(prev: bytes, body: bytes) -> str:
    """The hash of a record: sha256 of the former one's hash and the record's text up to where ``prev`` begins."""
    return hashlib.sha256(prev + body).hexdigest()


def _files(folder: Path) -> list[str]:
    """The names of the logs, the oldest first."""
    aside = sorted(path.name for path in folder.glob("audit-*.jsonl"))
    return [*aside, LOG] if os.path.lexists(folder / LOG) else aside


def _seal_at(path: Path) -> tuple[int, str] | None:
    try:
        with open(path, "rb", opener=_at_once) as seal:
            return sealed(seal.read(SEAL_BYTES))
    except (FileNotFoundError, _NoFile):
        return None


class _NoFile(OSError):
    """A link, pipe, device or folder is in the place of a log or seal."""


def _at_once(name: str, flags: int) -> int:
    """The descriptor of a regular file; what else is in its place may have no end, and is not waited for."""
    if not stat.S_ISREG(os.lstat(name).st_mode):
        raise _NoFile(errno.EINVAL, "it is no regular file", name)
    return os.open(name, flags | os.O_NONBLOCK | os.O_NOFOLLOW)


def sealed(data: bytes) -> tuple[int, str] | None:
    """Number and hash in a seal; None when it is none."""
    try:
        seal = json.loads(data)
        seq, digest = seal["seq"], seal["hash"]
    except (ValueError, LookupError, TypeError, RecursionError):
        return None
    return (seq, digest) if isinstance(seq, int) and isinstance(digest, str) and len(digest) == len(ORIGIN) else None


def main(arguments: list[str]) -> int:
    """``verify FOLDER [WITNESS]``: the verdict as one JSON object on standard output; exit status 0 without fault."""
    if not 2 <= len(arguments) <= 3 or arguments[0] != "verify":
        print("usage: chain.py verify FOLDER [WITNESS]", file=sys.stderr)
        return 2
    try:
        verdict = verify(*map(Path, arguments[1:]))
    except OSError as problem:
        print(
            f"{problem.filename or arguments[1]}: the log cannot be read: {problem.strerror or problem}",
            file=sys.stderr,
        )
        return 3
    print(json.dumps(asdict(verdict)))
    return 0 if verdict.ok else 1


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
