"""A client's own configuration file on disk: read with care, kept aside before a change, replaced as a whole.

The file is a person's, and its client may write it at any moment. It is written through a link, keeps its mode, and
is only replaced when it still is what was read.
"""

import os
import re
import stat
from dataclasses import dataclass
from pathlib import Path

from octoform.base import files
from octoform.diagnostics import Diagnostic, Span, error
from octoform.endpoint.mcp_clients.text_edit import Unreadable, place

BACKUPS = 3
LARGEST = 64 * 1024 * 1024
_BOM = b"\xef\xbb\xbf"
_SHOWN = 200


@dataclass(frozen=True, slots=True)
class ConfigFile:
    """What was found: ``path`` as a person names it, ``target`` behind links, ``data`` None for no file yet."""

    path: Path
    target: Path
    data: bytes | None
    mode: int

    @property
    def text(self) -> str:
        """The content without its byte order mark."""
        return (self.data or b"").removeprefix(_BOM).decode()

    def encoded(self, text: str) -> bytes:
        """The bytes of a new content, with the byte order mark that was there."""
        return (_BOM if (self.data or b"").startswith(_BOM) else b"") + text.encode()


def find(path: Path) -> ConfigFile | Diagnostic:
    """The file as it is now; CLIENT-UNWRITABLE when it is not ours to write, CLIENT-FILE-SYNTAX when it is no text."""
    try:
        target = path.resolve()
        facts = target.stat()
    except FileNotFoundError:
        return ConfigFile(path, target, None, 0o600)
    except (OSError, RuntimeError) as problem:
        return unwritable(path, getattr(problem, "strerror", None) or str(problem))
    if reason := _not_ours(facts):
        return unwritable(path, reason)
    try:
        data = files.read(target)
    except OSError as problem:
        return unwritable(path, problem.strerror or str(problem))
    found = ConfigFile(path, target, data, stat.S_IMODE(facts.st_mode))
    try:
        found.text.encode()
    except UnicodeDecodeError as problem:
        text = data[: problem.start].decode()
        return unreadable(path, text, Unreadable("this is no UTF-8", len(text)))
    return found


def _not_ours(facts: os.stat_result) -> str | None:
    if not stat.S_ISREG(facts.st_mode):
        return "it is no regular file"
    if facts.st_uid != os.geteuid():
        return "it belongs to another user"
    if not facts.st_mode & stat.S_IWUSR:
        return "its owner made it read-only"
    if facts.st_nlink > 1:
        return "it has several names (hard links), of which only one would see the change"
    return f"it has more than {LARGEST} bytes" if facts.st_size > LARGEST else None


def backups(path: Path) -> list[Path]:
    """What was kept of a file, the latest first."""
    pattern = re.compile(re.escape(path.name) + r"\.octoform-backup-(\d+)")
    found = [(int(match[1]), item) for item in _beside(path) if (match := pattern.fullmatch(item.name))]
    return [item for _, item in sorted(found, reverse=True)]


def _beside(path: Path) -> list[Path]:
    try:
        return list(path.parent.iterdir())
    except OSError:
        return []


def former_texts(path: Path) -> dict[Path, str]:
    """The texts of what was kept, the latest first; one that cannot be read is left out."""
    texts = {}
    for item in backups(path):
        found = find(item)
        if isinstance(found, ConfigFile):
            texts[item] = found.text
    return texts


def keep(found: ConfigFile) -> Path | Diagnostic:
    """Copy the file beside itself under the next number, same mode; the oldest go beyond three."""
    kept = backups(found.path)
    number = int(kept[0].name.rpartition("-")[2]) + 1 if kept else 1
    path = found.path.with_name(f"{found.path.name}.octoform-backup-{number}")
    try:
        _write(path, found.data or b"", found.mode)
        for item in kept[BACKUPS - 1 :]:
            item.unlink()
    except OSError as problem:
        return unwritable(path, problem.strerror or str(problem))
    return path


def replace(found: ConfigFile, data: bytes | None, mode: int) -> Diagnostic | bool:
    """Put the new bytes in the place of the file (None: remove it); False when it is no longer what was read."""
    try:
        found.target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        if _now(found.target) != found.data:
            return False
        if data is None:
            found.target.unlink()
        else:
            _write(found.target, data, mode)
    except OSError as problem:
        return unwritable(found.path, problem.strerror or str(problem))
    return True


def _now(path: Path) -> bytes | None:
    try:
        return files.read(path)
    except FileNotFoundError:
        return None


def _write(path: Path, data: bytes, mode: int) -> None:
    files.replace(path, data, mode, exact=True)


def unwritable(path: Path, reason: str) -> Diagnostic:
    """CLIENT-UNWRITABLE."""
    hint = "nothing was changed; octoform connect -print CLIENT prints what belongs into it"
    return error("CLIENT-UNWRITABLE", f"{path.name} is left alone: {reason}", path=str(path), hint=hint)


def unreadable(path: Path, text: str, found: Unreadable) -> Diagnostic:
    """CLIENT-FILE-SYNTAX at its place."""
    hint = "nothing was changed; correct the file, or add the entry yourself: octoform connect -print CLIENT"
    if found.offset is None:
        summary = f"{path.name} cannot be changed: {found.reason}"
        return error("CLIENT-FILE-SYNTAX", summary, path=str(path), hint=hint)
    summary = f"{path.name} cannot be read: {found.reason}"
    line, column, source = place(text, found.offset)
    # A line of such a file may be long, and may hold a secret further on.
    shown = source if len(source) <= _SHOWN else None
    return error("CLIENT-FILE-SYNTAX", summary, path=str(path), hint=hint, span=Span(line, column), source=shown)
