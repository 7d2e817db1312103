"""Copies of what was accepted and of what is served, by digest, from which a damaged file is put back.

Git may hold the same artifacts, but need not: a project is no repository, or what was accepted is not committed yet.
So every accepted file is kept once more on this machine. What is given back is compared with its digest first, so that
a damaged copy restores nothing. Bounded: a few generations of each node, and files of a sane size. Light.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from octoform import digest
from octoform.diagnostics import Diagnostic
from octoform.state.artifacts.accepted import contents
from octoform.base import files
from octoform.state.files import make_folders, read_regular, refused, write_atomic
from octoform.state.layout import Layout

FORMAT = 1
GENERATIONS = 2
"""What is accepted now, and what was accepted before: a rewrite that is taken back finds the former files."""
MOST_BYTES = 8_000_000
"""Of all files of one node together; artifacts are texts, and what is larger is made again rather than copied."""
ENDPOINT = "endpoint"
"""The endpoint's own files, by their names below its folder."""
INSTANCES = "instances"
"""The ledger of instances."""
_INDEX = "index.json"

Files = Mapping[str, bytes]
_Index = dict[str, list[dict[str, str]]]


def folder_digest(files: Files) -> str:
    """The digest by which a node's files are known: `octoform.state.artifacts.accepted.file_digest` of the same files."""
    return digest.of_value({name: digest.of_bytes(data) for name, data in files.items()})


def keep(layout: Layout, node: str, files: Files) -> Diagnostic | None:
    """Keep a copy of a node's files as its newest generation; why that is not done, None when it is.

    What is larger than ``MOST_BYTES`` in all is not kept, and that is no problem. For the holder of the state's lock.
    """
    if sum(len(data) for data in files.values()) > MOST_BYTES:
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
    named = {_place(layout, one) for generations in index.values() for each in generations for one in each.values()}
    for path in layout.kept.iterdir():
        if path.name != _INDEX and path not in named and not path.is_dir():
            path.unlink(missing_ok=True)
    return None


def _read(layout: Layout) -> _Index:
    """The index; empty where there is none that can be used. Copies are believed by their digests, never by it."""
    data, _ = read_regular(layout.kept / _INDEX)
    try:
        document: Any = files.parse(data or b"")
        nodes = document["nodes"] if document["format"] == FORMAT else {}
        return {
            str(node): [{str(name): str(one) for name, one in each.items()} for each in generations]
            for node, generations in nodes.items()
        }
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}  # made anew by whatever is kept next


def _copy(layout: Layout, wanted: str) -> bytes | None:
    data, _ = read_regular(_place(layout, wanted))
    return data if data is not None and digest.of_bytes(data) == wanted else None


def _place(layout: Layout, wanted: str) -> Path:
    return layout.kept / Path(wanted.removeprefix(digest.PREFIX)).name
