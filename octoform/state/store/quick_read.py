"""The state file without pydantic: enough to find that nothing has to be done, and what is wrong with a bad file.

A no-op plan may not wait for a validation library. The checks here are those of the container (is it whole, is it a
state, of this host, of a format that is understood); the heavy reader adds the fields. Light.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base import files
from octoform.diagnostics import Diagnostic, error
from octoform.patterns import regex
from octoform.state.files import display, read_regular
from octoform.state.layout import Layout

FORMAT = 1
_ZERO = b"\0"
_OURS, _THEIRS = b"<<<<<<< ", b">>>>>>> "
_BEGINNING = regex(r"(?:n|nu|nul|t|tr|tru|f|fa|fal|fals|[\d.eE+-]+)$")
_ESCAPE_LENGTH = len(r"\u0000")


def backup_path(layout: Layout) -> Path:
    """Where the snapshot before the present one is kept; local, never in git."""
    return layout.local / "state.json.backup"


def peek(layout: Layout) -> dict[str, Any] | None:
    """The settled state document, or None when there is none, it is damaged, or a journal waits to be folded.

    None means: ask `octoform.state.store.store.StateStore`, which determines the reason.
    """
    try:
        if layout.journal.stat(follow_symlinks=False).st_size > 0:
            return None
    except FileNotFoundError:
        pass
    except OSError:
        return None
    data, problem = read_regular(layout.snapshot)
    if data is None or problem is not None:
        return None
    document, found = parse(data, layout)
    return document if document is not None and not found and _is_whole(document) else None


def parse(data: bytes, layout: Layout) -> tuple[dict[str, Any] | None, list[Diagnostic]]:
    """The JSON object in ``data`` when it is a state of this host in a known format, else why not."""
    if not data.strip(b"\0\t\r\n "):
        return None, [_bad(layout, "STATE-TRUNCATED", "the state file is empty")]
    if data.endswith(b"\0"):
        summary = f"the state file ends in zero bytes after byte {len(data.rstrip(_ZERO))}: a disk lost its power"
        return None, [_bad(layout, "STATE-TRUNCATED", summary)]
    if _has_markers(data):
        summary = "the state file holds git's conflict markers: two histories of it were merged"
        return None, [_bad(layout, "STATE-CONFLICT", summary)]
    try:
        document = files.parse(data)
    except ValueError as problem:
        return None, [_undecodable(data, problem, layout)]
    return _container(document, layout)


def _has_markers(data: bytes) -> bool:
    lines = data.splitlines()
    return any(line.startswith(_OURS) for line in lines) and any(line.startswith(_THEIRS) for line in lines)


def _undecodable(data: bytes, problem: Exception, layout: Layout) -> Diagnostic:
    """A document that starts well and ends before its end was cut; anything else was never a state."""
    if data.lstrip().startswith(b"{") and _cut(problem):
        summary = f"the state file ends in the middle, after {len(data)} bytes"
        return _bad(layout, "STATE-TRUNCATED", summary)
    where = str(problem)
    if isinstance(problem, UnicodeDecodeError):
        where = "it is no UTF-8"
    elif isinstance(problem, json.JSONDecodeError):
        where = f"line {problem.lineno}, column {problem.colno}: {problem.msg}"
    return _bad(layout, "STATE-NOT-STATE", f"the state file is not JSON ({where})")


def _cut(problem: Exception) -> bool:
    """Whether decoding failed only because there is no more: mid-structure, mid-string, mid-word, mid-character."""
    if isinstance(problem, UnicodeDecodeError):
        return problem.reason == "unexpected end of data"
    if not isinstance(problem, json.JSONDecodeError):
        return False
    rest = problem.doc[problem.pos :].strip()
    in_escape = problem.msg.startswith("Invalid \\") and len(rest) < _ESCAPE_LENGTH
    return not rest or in_escape or "Unterminated" in problem.msg or bool(_BEGINNING.match(rest))


def _container(document: object, layout: Layout) -> tuple[dict[str, Any] | None, list[Diagnostic]]:
    if not isinstance(document, dict) or not isinstance(document.get("format"), int):
        return None, [_bad(layout, "STATE-NOT-STATE", "the file is JSON but no octoform state (it has no `format`)")]
    try:
        files.record(document, FORMAT)
    except files.OtherFormatError as other:
        if not other.is_newer:
            return None, [_bad(layout, "STATE-NOT-STATE", f"there is no state format {document['format']}")]
        writer = document.get("octoform", "a newer one")
        summary = f"the state has format {document['format']}, written by octoform {writer}; this one knows {FORMAT}"
        hint = "use that octoform or a newer one; an older one could drop what it does not know"
        return None, [error("STATE-NEWER", summary, path=display(layout.snapshot), hint=hint)]
    if document.get("host") != layout.host:
        summary = f"this is the state of host {document.get('host')!r}, not of {layout.host!r}"
        hint = "move the folder back to that host's name, or give the manifest's `host` that name"
        return None, [error("STATE-OTHER-HOST", summary, path=display(layout.snapshot), pointer="/host", hint=hint)]
    if not _well_formed(document):
        return None, [_bad(layout, "STATE-NOT-STATE", "the state file lacks its lineage, serial or nodes")]
    return document, []


def _well_formed(document: dict[str, Any]) -> bool:
    serial, nodes = document.get("serial"), document.get("nodes")
    counted = isinstance(serial, int) and not isinstance(serial, bool) and serial >= 0
    named = isinstance(document.get("lineage"), str) and document["lineage"] != ""
    return counted and named and isinstance(nodes, dict) and all(isinstance(node, dict) for node in nodes.values())


_TEXT, _TEXT_OR_NONE, _NUMBER = (str,), (str, type(None)), (int, float)
_SNAPSHOT: Mapping[str, tuple[type, ...]] = {
    "octoform": _TEXT,
    "manifest_digest": _TEXT_OR_NONE,
    "git": (dict, type(None)),
    "tier1": (bool,),
}
_GIT: Mapping[str, tuple[type, ...]] = {"revision": _TEXT_OR_NONE, "dirty": (list,)}
_NODE: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("key", "output_digest", "file_digest", "status"), _TEXT),
    **dict.fromkeys(("harness", "model", "program", "specs", "accepted_at"), _TEXT_OR_NONE),
    **dict.fromkeys(("key_parts", "platform", "usage", "detail"), (dict,)),
    "attempts": (int,),
    "seconds": _NUMBER,
    "tainted": (bool,),
}
_USAGE: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("input_tokens", "cached_tokens", "output_tokens"), (int, type(None))),
    "cost_usd": (*_NUMBER, type(None)),
    "cost_source": _TEXT_OR_NONE,
}
_STATUS = ("accepted", "interrupted", "failed")
_TIME = regex(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)")


def _is_whole(document: Mapping[str, Any]) -> bool:
    """Whether the heavy reader would take it, as far as types and fixed words go; a test compares the two."""
    git = document.get("git") or {}
    nodes = document["nodes"].values()
    return (
        "octoform" in document
        and _typed(document, _SNAPSHOT)
        and _typed(git, _GIT)
        and all(isinstance(item, str) for item in git.get("dirty", ()))
        and all(map(_is_whole_node, nodes))
    )


def _is_whole_node(node: Mapping[str, Any]) -> bool:
    if not _typed(node, _NODE):
        return False
    texts, time = (*node.get("key_parts", {}).values(), *node.get("platform", {}).values()), node.get("accepted_at")
    return (
        all(isinstance(item, str) for item in texts)
        and _typed(node.get("usage", {}), _USAGE)
        and node.get("status", "accepted") in _STATUS
        and (time is None or _TIME.fullmatch(time) is not None)
    )


def _typed(values: Mapping[str, Any], types: Mapping[str, tuple[type, ...]]) -> bool:
    return all(
        isinstance(values[name], wanted) and (bool in wanted or not isinstance(values[name], bool))
        for name, wanted in types.items()
        if name in values
    )


def _bad(layout: Layout, code: str, summary: str) -> Diagnostic:
    return error(code, summary, path=display(layout.snapshot), hint=recovery(layout))


def recovery(layout: Layout) -> str:
    """One sentence that names the previous good copy, or states that this machine has none."""
    target = display(layout.snapshot)
    kept = backup_path(layout)
    data, problem = read_regular(kept)
    if data is not None and problem is None:
        serial = _serial(data, layout.host)
        if serial is not None:
            return f"the previous good copy (serial {serial}) is {display(kept)}; copy it to {target}"
    return f"restore it from git (git log -- {target}); this machine keeps no earlier copy"


def _serial(data: bytes, host: str) -> int | None:
    try:
        document = files.record(files.parse(data), FORMAT)
    except ValueError:
        return None
    if document.get("host") != host:
        return None
    serial = document.get("serial")
    return serial if isinstance(serial, int) else None
