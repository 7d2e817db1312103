"""The daemon's files: small JSON files of one format, never half written, never silently lost.

A file that is damaged, of a newer octoform or no file at all is moved to another name and reported; the daemon
then begins with what it would have known on its first day. While it lives it alone writes them: what somebody else
makes of them meanwhile is noticed, and what it knows itself is written again. Light.
"""

import contextlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.base.files import OtherFormatError, move, parse, private_folder, record
from octoform.diagnostics import Diagnostic, warning
from octoform.state.files import display, read_regular, write_atomic
from octoform.state.layout import Layout

FORMAT = 1
LIMIT = 8_000_000
"""Bytes of one file; what is larger was not written here."""


@dataclass(slots=True)
class Shelf:
    """The files of one host's daemon. ``said`` collects what could not be read or written, until it is reported."""

    layout: Layout
    said: list[Diagnostic] = field(default_factory=list)
    strange: set[str] = field(default_factory=set)
    """Names of files that somebody else has changed or removed since this was emptied last."""
    _mine: dict[str, tuple[int, int, int] | None] = field(default_factory=dict)

    def path(self, name: str) -> Path:
        """Where a file lies."""
        return self.layout.daemon / name

    def read(self, name: str) -> dict[str, Any]:
        """A file's document; an empty one when there is none, or when it was moved away."""
        path = self.path(name)
        data, problem = read_regular(path, LIMIT)
        self.wrote(name)
        if data is None and problem is None:
            return {}
        try:
            return record(parse(data or b""), FORMAT)
        except OtherFormatError:
            self.move_aside(path, "it was written by another version")
        except ValueError:
            self.move_aside(path, "it is damaged")
        return {}

    def write(self, name: str, document: Mapping[str, Any]) -> bool:
        """Replace a file as a whole; False for a refusal by the disk, which is stated: the former one stays."""
        path = self.path(name)
        self.is_mine(name)
        with contextlib.suppress(OSError):  # the write reports what is wrong
            private_folder(path.parent)
        data = json.dumps({"format": FORMAT, **document}, separators=(",", ":")).encode() + b"\n"
        if problem := write_atomic(path, data, 0o600):
            self.said.append(problem)
            return False
        self.wrote(name)
        return True

    def wrote(self, name: str) -> None:
        """The file is as it should be now: only this process has changed it."""
        self._mine[name] = _stamp(self.path(name))

    def is_mine(self, name: str) -> bool:
        """False when somebody else has changed the file since it was read or written here, which is stated."""
        if name not in self._mine or _stamp(self.path(name)) == self._mine[name]:
            return True
        self.strange.add(name)
        self.wrote(name)
        summary = "a file of the daemon was changed by somebody else; what the daemon knows is written again"
        hint = "these files are no settings: change them by octoform heal -retry, pause and claims"
        self.said.append(warning("DAEMON-MEMORY-CHANGED", summary, path=display(self.path(name)), hint=hint))
        return False

    def move_aside(self, path: Path, why: str) -> None:
        """Move a foreign file away, and report it; it replaces the one that was moved before."""
        kept = path.with_name(f"{path.name}.damaged")
        try:
            move(path, kept)
            detail = f"it was moved to {kept.name}"
        except OSError as problem:
            detail = f"it cannot be moved away: {problem.strerror}"
        self.wrote(path.name)
        hint = "nothing is to be done; the daemon starts a new one"
        item = warning("DAEMON-MEMORY-DAMAGED", why, path=display(path), detail=detail, hint=hint)
        self.said.append(item)

    def new_diagnostics(self) -> tuple[Diagnostic, ...]:
        """The diagnostics since the last call."""
        found = tuple(self.said)
        self.said.clear()
        return found


def _stamp(path: Path) -> tuple[int, int, int] | None:
    try:
        found = os.lstat(path)
    except OSError:
        return None
    return found.st_ino, found.st_size, found.st_mtime_ns


def number(value: object, default: float = 0.0) -> float:
    """A finite number of a document; ``default`` when it is none."""
    found = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else default
    return found if math.isfinite(found) else default
