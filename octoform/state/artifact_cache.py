"""Copies of what was accepted and of what is served, by digest, from which a damaged file is put back.

Git may hold the same artifacts, but need not: a project is no repository, or what was accepted is not committed yet.
So every accepted file is kept once more on this machine. What is given back is compared with its digest first, so that
a damaged copy restores nothing. Bounded: a few generations of each node, and files of a sane size. Light.
"""

import json
import os
import re
import shutil
import stat
from collections.abc import Iterable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import Any

from octoform.base import digest, files
from octoform.base.files import parse, private_folder
from octoform.base.shape import INSTANCES as FORM
from octoform.base.shape import fits
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex
from octoform.state.accepted import contents
from octoform.state.files import display, make_folders, read_regular, refused, write_atomic
from octoform.state.layout import Layout

FORMAT = 1
GENERATIONS = 2
"""The present and the former accepted files: a rewrite that is taken back finds the former files."""
MAX_BYTES = 8_000_000
"""Of all files of one node together; artifacts are texts, and what is larger is made again rather than copied."""
ENDPOINT = "endpoint"
"""The endpoint's own files, by their names below its folder."""
INSTANCES = "instances"
"""The ledger of instances."""
_INDEX = "index.json"

Files = Mapping[str, bytes]
_Index = dict[str, list[dict[str, str]]]


def folder_digest(files: Files) -> str:
    """The digest by which a node's files are known: that of `artifacts.accepted.file_digest` for the same files."""
    return digest.of_value({name: digest.of_bytes(data) for name, data in files.items()})


def keep(layout: Layout, node: str, files: Files) -> Diagnostic | None:
    """Keep a copy of a node's files as its newest generation; why that is not done, None when it is.

    What is larger than ``MAX_BYTES`` in all is not kept, and that is no problem. For the holder of the state's lock.
    """
    if sum(len(data) for data in files.values()) > MAX_BYTES:
        return None
    digests = {name: digest.of_bytes(data) for name, data in files.items()}
    index = _read(layout)
    if index.get(node, [None])[-1] == digests and all(_copy(layout, one) is not None for one in digests.values()):
        return None
    problem = make_folders(layout)
    if problem is not None:
        return problem
    try:
        layout.kept.mkdir(mode=0o700, exist_ok=True)
    except OSError:
        return make_folders(layout)
    for name, data in files.items():
        if _copy(layout, digests[name]) is None and (problem := _write_copy(_place(layout, digests[name]), data)):
            return problem
    index[node] = [*(one for one in index.get(node, ()) if one != digests), digests][-GENERATIONS:]
    return _write(layout, index)


def keep_accepted(layout: Layout, accepted: Mapping[str, str]) -> Diagnostic | None:
    """Keep what lies there as it was accepted; ``accepted`` is each node's file digest as the state has it.

    What is kept already is not read again, and what is not as it was accepted is not kept.
    """
    for node, wanted in accepted.items():
        if not wanted or has(layout, node, wanted):
            continue
        files = contents(layout, node)
        if files is not None and folder_digest(files) == wanted:
            problem = keep(layout, node, files)
            if problem is not None:
                return problem
    return None


def kept(layout: Layout, node: str, wanted: str | None = None) -> dict[str, bytes] | None:
    """The files of a node whose `folder_digest` is ``wanted`` (None: the newest); None when not all are there whole."""
    for digests in reversed(_read(layout).get(node, [])):
        if wanted is None or digest.of_value(digests) == wanted:
            found = {name: _copy(layout, one) for name, one in digests.items()}
            whole = {name: data for name, data in found.items() if data is not None}
            return whole if len(whole) == len(found) else None
    return None


def generations(layout: Layout, node: str) -> list[dict[str, bytes]]:
    """The files of each generation of a node that is kept whole, the newest first."""
    digests = [digest.of_value(one) for one in reversed(_read(layout).get(node, []))]
    return [found for one in digests if (found := kept(layout, node, one)) is not None]


def has(layout: Layout, node: str, wanted: str) -> bool:
    """True when a generation of that digest is listed; whether its copies are whole shows only when they are read."""
    return any(digest.of_value(digests) == wanted for digests in _read(layout).get(node, []))


def forget(layout: Layout, nodes: Iterable[str]) -> Diagnostic | None:
    """Drop the copies of these nodes: they were destroyed."""
    index, gone = _read(layout), set(nodes)
    left = {name: generations for name, generations in index.items() if name not in gone}
    if not left:
        shutil.rmtree(layout.kept, ignore_errors=True)
        return None
    return None if left == index else _write(layout, left)


def _write_copy(path: Path, data: bytes) -> Diagnostic | None:
    """Write one copy; not synced, since one that a power cut has torn is known by its digest and is written again."""
    try:
        files.replace(path, data, synced=False)
    except OSError as problem:
        return refused(problem, path)
    return None


def _write(layout: Layout, index: _Index) -> Diagnostic | None:
    """The index, then the copies that nothing names any more go; a kill in between leaves only too many."""
    text = json.dumps({"format": FORMAT, "nodes": index}, indent=1).encode()
    problem = write_atomic(layout.kept / _INDEX, text, 0o600)
    if problem is not None:
        return problem
    named = {_name(one) for generations in index.values() for each in generations for one in each.values()}
    for path in layout.kept.iterdir():
        if path.name != _INDEX and path.name not in named and not path.is_dir():
            path.unlink(missing_ok=True)
    return None


def _read(layout: Layout) -> _Index:
    """The index; empty where there is none that can be used. Copies are believed by their digests, never by it.

    Each node in it has at least one generation.
    """
    data, _ = read_regular(layout.kept / _INDEX)
    try:
        nodes: Any = files.record(files.parse(data or b""), FORMAT)["nodes"]
        return {
            str(node): [{str(name): str(one) for name, one in each.items()} for each in generations]
            for node, generations in nodes.items()
            if generations
        }
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}  # made again by the next copy


def _copy(layout: Layout, wanted: str) -> bytes | None:
    data, _ = read_regular(_place(layout, wanted))
    return data if data is not None and digest.of_bytes(data) == wanted else None


def _place(layout: Layout, wanted: str) -> Path:
    return layout.kept / _name(wanted)


def _name(wanted: str) -> str:
    """The name of the copy with that digest; no path, even if another has written the index."""
    return wanted.removeprefix(digest.PREFIX).rpartition("/")[2]


# Whether an accepted file that is not as it was accepted is damaged or was edited, and where what was there is put.
#
# The rule, which the daemon's repairs stand on:
#
# * *Damage* is what no person wants: the file is missing, is a link or no file at all, is empty, ends in the middle of
# what was accepted, holds zero bytes or conflict markers, is no UTF-8, or is no longer the kind of file that it was
# (a ``.py`` that does not compile, a ``.json`` that is no JSON). It is put back as it was accepted.
# * Everything else is an *edit*: whole, readable, different. A person may have meant it; `octoform plan` shows it as
# drift, and a person decides. So it stays.
#
# What is put back over something never destroys it: what was there is moved away first and named. Light.

MAX_ASIDE = 30
"""Folders of damaged files that are kept; those with edits of committed files are never dropped by octoform."""
_MARKER = regex(rb"^(<{7} |>{7} )", re.MULTILINE)


class Damage(StrEnum):
    """The kinds of damage of a file; the last one is none."""

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
    """True when the bytes are still the kind of file that the name states."""
    try:
        text = data.decode()
        if name.endswith(".json"):
            parse(data)
        elif name.endswith(".py"):
            compile(text, name, "exec", dont_inherit=True)
    except (ValueError, SyntaxError, RecursionError, MemoryError):
        return False
    return True


def move_aside(layout: Layout, path: Path, stamp: str, why: Damage) -> tuple[Path | None, Diagnostic | None]:
    """Move what is at ``path`` to a private folder, as it is; where it lies now (None: nothing was there), or why not.

    ``stamp`` names the folder (RFC 3339). A link is moved itself, never what it points to.
    """
    if not os.path.lexists(path):
        return None, None
    # What somebody wrote into a committed file may be work, and is kept; octoform alone writes the other files.
    kind = "edited" if why is Damage.EDITED and path.is_relative_to(layout.committed) else "damaged"
    try:
        inside = path.relative_to(layout.project)
    except ValueError:
        inside = Path(path.name)
    target = _damaged_folder(layout) / f"{stamp.replace(':', '')}-{kind}" / inside
    try:
        private_folder(target.parent)
        while os.path.lexists(target):
            target = target.with_name(f"{target.name}.again")
        shutil.move(path, target)  # a file or folder, perhaps from another file system, to a free name
    except (OSError, shutil.Error) as problem:
        return None, refused(problem if isinstance(problem, OSError) else OSError(None, str(problem)), target)
    _bound(layout)
    return target, None


def _damaged_folder(layout: Layout) -> Path:
    return layout.daemon / "aside"


def _bound(layout: Layout) -> None:
    found = sorted(path for path in _damaged_folder(layout).iterdir() if path.name.endswith("-damaged"))
    for path in found[:-MAX_ASIDE]:
        shutil.rmtree(path, ignore_errors=True)


# The ledger of instances: which serial number, port and node each device id has on this very machine.
#
# Git gets kinds only; this file keeps what differs between two machines of one kind, readable by its owner alone. The
# generated server's runtime reads it at call time. Light.


def write_instances(layout: Layout, devices: Mapping[str, object]) -> list[Diagnostic]:
    """Write device id to instance, mode 0600 in a folder of mode 0700; empty list when it is on disk."""
    document = {"format": FORMAT, "devices": dict(devices)}
    text = json.dumps(document, indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False) + "\n"
    data = text.encode("utf-8", "surrogatepass")
    problem = make_folders(layout) or write_atomic(layout.instances, data, 0o600)
    if problem is not None:
        return [problem]
    keep(layout, INSTANCES, {layout.instances.name: data})  # without room for a copy the ledger stands all the same
    return []


def classes_of(instance: object) -> list[str]:
    """The classes of a device's nodes, as its entry in the ledger has them; empty where it has none."""
    nodes = instance.get("nodes") if isinstance(instance, Mapping) else None
    return sorted({str(item["class"]) for item in nodes or () if item.get("class")})


def read_instances(layout: Layout) -> tuple[dict[str, object] | None, list[Diagnostic]]:
    """Device id to instance; (None, []) when PROBE was never accepted on this machine."""
    data, problem = read_regular(layout.instances)
    if data is None:
        return None, [problem] if problem is not None else []
    try:
        found = files.record(files.parse(data, any_text=False), FORMAT)
    except ValueError:
        found = {}
    if fits(found, FORM):
        return found["devices"], []
    hint = "run `octoform apply -replace probe`: PROBE writes it again"
    return None, [error("STATE-INSTANCES", "this is no ledger of instances", path=display(layout.instances), hint=hint)]
