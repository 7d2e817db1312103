"""New lines of a log, whatever becomes of the file: set aside, cut, replaced or no text at all. (Light.)

A place in a file is remembered with the file's own number, so that lines which were written before a log was set aside
are still read from where it lies now, and none is read twice.
"""

import os
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse

MOST_BYTES = 4_000_000
"""What is read at one look; of a log that grew by more, the newest of it."""
LONGEST_LINE = 1_000_000


class Tail:
    """The lines of one log from a place on. A new one begins at the log's end: what was before is nobody's news."""

    def __init__(self, path: Path, place: Mapping[str, Any] | None = None) -> None:
        """``place`` is a former `place`; one that does not fit is as good as none."""
        self._path = path
        self._file, self._offset = _read(place)
        self.left_out = 0
        """Bytes that were passed over because there were too many."""
        if self._file is None:
            self.skip()

    @property
    def place(self) -> dict[str, Any]:
        """Where the next look begins, as JSON."""
        return {"file": list(self._file) if self._file else None, "offset": self._offset}

    def skip(self) -> None:
        """Go to the end: what was written until now is not to be judged."""
        found = _stat(self._path)
        self._file, self._offset = (_number(found), found.st_size) if found else ((0, 0), 0)

    def lines(self) -> list[str]:
        """The whole lines since the last time, as text; bytes that are none are replaced."""
        found = []
        there = _stat(self._path)
        if there is not None and _number(there) != self._file:
            former = self._moved()
            if former is not None:
                found += self._more(former)
            self._file, self._offset = _number(there), 0
        if there is not None:
            found += self._more(self._path)
        return found

    def _moved(self) -> Path | None:
        """Where the file lies that was read until now: beside the new one, under a name that begins with its own."""
        for path in sorted(self._path.parent.glob(f"{self._path.name}.*")):
            there = _stat(path)
            if there is not None and _number(there) == self._file:
                return path
        return None

    def _more(self, path: Path) -> list[str]:
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError:
            return []
        there = os.fstat(descriptor)
        if not stat.S_ISREG(there.st_mode):
            os.close(descriptor)
            self._offset = 0
            return []  # a pipe or a folder in its place has no lines
        with os.fdopen(descriptor, "rb") as log:
            size = there.st_size
            if size < self._offset:  # it was cut
                self._offset = 0
            cut = size - self._offset > MOST_BYTES
            if cut:
                self.left_out += size - MOST_BYTES - self._offset
                self._offset = size - MOST_BYTES
            log.seek(self._offset)
            data = log.read(MOST_BYTES)
        end = data.rfind(b"\n") + 1
        if not end and len(data) > LONGEST_LINE:
            end = len(data)  # what has no end is no line worth waiting for
        self._offset += end
        lines = data[:end].split(b"\n")[int(cut) :]
        return [line.decode("utf-8", "replace") for line in lines if line.strip()]


def _stat(path: Path) -> os.stat_result | None:
    try:
        return path.stat(follow_symlinks=False)
    except OSError:
        return None


def _number(found: os.stat_result) -> tuple[int, int]:
    return found.st_dev, found.st_ino


def _read(place: Mapping[str, Any] | None) -> tuple[tuple[int, int] | None, int]:
    try:
        device, inode = (place or {})["file"]
        return (int(device), int(inode)), int((place or {})["offset"])
    except (LookupError, TypeError, ValueError):
        return None, 0


def objects(lines: list[str]) -> Iterator[dict[str, Any]]:
    """The lines that are JSON objects; what is none says nothing here."""
    for line in lines:
        try:
            value = parse(line)
        except ValueError:
            continue
        if isinstance(value, dict):
            yield value
