"""What the ledger of claims says must be restricted: believed where the file that octoform makes of it is not there.

That file knows every word for a unit; the ledger has the one of the claim alone. A word that no tool has means every
unit, so what comes of this restricts as much or more until octoform writes the file again. Where neither can be read,
nothing moves.
"""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import read_json

from .restrictions import NOBODY_KNOWS, Entry

NAME = "claims.json"
FORMAT = 1
SIZE = 8 * 1024 * 1024
WITNESS = "forbidden.json"
UNTOLD = "c0"


class Forbidden:
    """The ids of a person's restrictions at ``path``, read again when it changes. Not safe to use from threads."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._seen: tuple[int, int, int] | None = None
        self._ids: frozenset[str] = frozenset()

    def __call__(self) -> frozenset[str]:
        """Those that must be in force; one that no restriction has where the file cannot be read."""
        try:
            status = os.lstat(self._path)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
            if stamp != self._seen:
                self._ids = frozenset(str(each) for each in read_json(self._path, SIZE, follow=False)["claims"])
                self._seen = stamp
        except FileNotFoundError:
            self._seen, self._ids = None, frozenset()
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            self._seen, self._ids = None, frozenset((UNTOLD,))
        return self._ids


class Standing:
    """The restrictions of the ledger at ``path``, read again when it changes. Not safe to use from threads."""

    def __init__(self, path: Path, boot: str) -> None:
        self._path, self._boot = path, boot
        self._seen: tuple[int, int, int] | None = None
        self._entries: tuple[Entry, ...] | None = None

    def __call__(self) -> tuple[Entry, ...] | None:
        """What it says; None where there is none. Of one that cannot be read nobody knows what a person forbade."""
        try:
            status = os.lstat(self._path)
            stamp = status.st_ino, status.st_mtime_ns, status.st_size
            if stamp != self._seen:
                self._seen, self._entries = stamp, (NOBODY_KNOWS,)
                self._entries = tuple(self._read())
        except FileNotFoundError:
            self._seen = self._entries = None
        except (OSError, ValueError, LookupError, TypeError, AttributeError):
            self._entries = (NOBODY_KNOWS,)
        return self._entries

    def _read(self) -> Iterator[Entry]:
        document = read_json(self._path, SIZE, follow=False, any_text=True)
        if document["format"] != FORMAT:
            raise ValueError(f"format {document['format']!r} is not known")
        here = document["boot"] == self._boot
        for claim in document["claims"]:
            if claim["state"] == "active" and (here or claim["expires"] is None):
                yield from _of(claim)


def _of(claim: Mapping[str, Any]) -> Iterator[Entry]:
    """Its declaration, and what it restricts for a time."""
    kind, _, name = str(claim["target"]).partition(":")
    device, _, unit = name.partition("/") if kind == "device" else ("", "", "")
    expires = None if claim["expires"] is None else float(claim["expires"])
    end = expires, str(claim["expires_at"])
    identity, statement, units = str(claim["id"]), str(claim["statement"]), (unit,) if unit else ()
    if claim["irreversible"] is not None:
        tool = name if kind == "tool" else ""
        yield Entry(identity, tool, (), "deny", statement, *end, device, units, str(claim["irreversible"]))
    for each in claim["restrictions"]:
        tool, effect = str(each["tool"]), str(each["effect"])
        if units:
            yield Entry(identity, tool, (), effect, statement, *end, device, units)
        else:
            arguments = tuple((str(key), (value,)) for key, value in sorted(each["arguments"].items()))
            yield Entry(identity, tool, arguments, effect, statement, *end)
