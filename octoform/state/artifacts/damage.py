"""Whether an accepted file that is not as it was accepted is damaged or was edited, and where what was there is put.

The rule, which the daemon's repairs stand on:

* *Damage* is what no person wants: the file is missing, is a link or no file at all, is empty, ends in the middle of
  what was accepted, holds zero bytes or conflict markers, is no UTF-8, or is no longer the kind of file that it was
  (a ``.py`` that does not compile, a ``.json`` that is no JSON). It is put back as it was accepted.
* Everything else is an *edit*: whole, readable, different. A person may have meant it; `octoform plan` shows it as
  drift, and a person decides. So it stays.

What is put back over something never destroys it: what was there is moved aside first and named. Light.
"""

from octoform.base.files import parse
import json
import os
import re
import shutil
import stat
from enum import StrEnum
from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.state.files import read_regular, refused
from octoform.state.layout import Layout

MOST_ASIDE = 30
"""Folders of damaged files that are kept; those with edits of committed files are never dropped by octoform."""
_MARKER = re.compile(rb"^(<{7} |>{7} )", re.MULTILINE)


class Damage(StrEnum):
    """What is wrong with a file; the last one is no damage."""

    MISSING = "missing"
    LINK = "a link or no file"
    TRUNCATED = "truncated"
    BROKEN = "broken"
    EDITED = "edited"


def damage_of(path: Path, wanted: bytes) -> Damage | None:
    """How the file at ``path`` differs from ``wanted``; None when it does not."""
    try:
        kind = path.lstat().st_mode
    except FileNotFoundError:
        return Damage.MISSING
    except OSError:
        return Damage.LINK  # a file or a link stands where a folder of it should be
    if not stat.S_ISREG(kind):
        return Damage.LINK
    data, _ = read_regular(path)
    if data is None:
        return Damage.BROKEN
    return None if data == wanted else _of_bytes(path.name, data, wanted)


def _of_bytes(name: str, data: bytes, wanted: bytes) -> Damage:
    if not data.strip() or wanted.startswith(data):
        return Damage.TRUNCATED
    if b"\0" in data or _MARKER.search(data) or not _is_whole(name, data):
        return Damage.BROKEN
    return Damage.EDITED


def _is_whole(name: str, data: bytes) -> bool:
    """True when the bytes are still the kind of file that the name says."""
    try:
        text = data.decode()
        if name.endswith(".json"):
            parse(data)
        elif name.endswith(".py"):
            compile(text, name, "exec", dont_inherit=True)
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return False
    return True


def set_aside(layout: Layout, path: Path, stamp: str, why: Damage) -> tuple[Path | None, Diagnostic | None]:
    """Move what is at ``path`` to a private folder, as it is; where it lies now (None: nothing was there), or why not.

    ``stamp`` names the folder (RFC 3339). A link is moved itself, never what it points to.
    """
    if not os.path.lexists(path):
        return None, None
    # What somebody wrote into a committed file may be work, and is kept; what octoform alone writes is no place for any.
    kind = "edited" if why is Damage.EDITED and path.is_relative_to(layout.committed) else "damaged"
    try:
        inside = path.relative_to(layout.project)
    except ValueError:
        inside = Path(path.name)
    target = _aside(layout) / f"{stamp.replace(':', '')}-{kind}" / inside
    try:
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        while os.path.lexists(target):
            target = target.with_name(f"{target.name}.again")
        shutil.move(path, target)
    except (OSError, shutil.Error) as problem:
        return None, refused(problem if isinstance(problem, OSError) else OSError(None, str(problem)), target)
    _bound(layout)
    return target, None


def _aside(layout: Layout) -> Path:
    return layout.daemon / "aside"


def _bound(layout: Layout) -> None:
    found = sorted(path for path in _aside(layout).iterdir() if path.name.endswith("-damaged"))
    for path in found[:-MOST_ASIDE]:
        shutil.rmtree(path, ignore_errors=True)
