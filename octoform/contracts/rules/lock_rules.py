"""Rules for the lock of DEPLOY: exact, with hashes, from the one index.

The resolver wrote it, but it lies in git where anybody may edit it, and it decides what code runs beside hardware.
Light.
"""

import re
from collections.abc import Iterator

from octoform.base.escaping import display, flattened
from octoform.contracts.model import JsonObject
from octoform.contracts.server_code.script_header import normalised
from octoform.diagnostics import Diagnostic, Span, error
from octoform.patterns import regex

_PINNED = regex(
    r"(?P<name>[A-Za-z0-9](?:[A-Za-z0-9._-]*[A-Za-z0-9])?)(?:\[[^\]]*\])?\s*==\s*(?P<version>[0-9][A-Za-z0-9.+!_-]*)"
    r"(?P<rest>(?:\s*;[^#]*?)?(?:\s+--hash=\S+)*)\s*"
)
_HASH = regex(r"--hash=sha256:[0-9a-f]{64}(?=\s|$)")
_ELSEWHERE = regex(r"@|://|^\s*(?:-e\b|--editable\b|[./~])|\bfile:", re.IGNORECASE)
_INDEX = regex(r"^\s*(?:-i|-f|--index-url|--extra-index-url|--find-links|--no-index|--trusted-host|--pre)\b")


def deploy_lock(lock_text: str, deploy: JsonObject, path: str | None = None) -> list[Diagnostic]:
    """Diagnostics for a lock in pip's requirements format as the lock of a DEPLOY artifact.

    Every entry is pinned with ``==`` and has SHA-256 hashes; no entry comes from a URL or a path, no line names
    another index; every requirement of ``deploy`` is in it with its version.
    """
    out: list[Diagnostic] = []
    locked: dict[str, str] = {}
    for number, line in _logical_lines(lock_text):
        problem = _entry(line, locked)
        if problem is not None:
            code, summary, hint = problem
            shown_line = flattened(line[:200])
            out.append(error(code, summary, path=path, span=Span(number, 1), source=shown_line, hint=hint))
    for item in deploy["requirements"]:
        version = locked.get(normalised(item["name"]))
        if version != item["version"]:
            found = f"has version {version}" if version else "is not in the lock"
            summary = f"{display(item['name'])} {found}; DEPLOY requires exactly {item['version']}"
            out.append(error("DEPLOY-LOCK-MISSING", summary, path=path, hint="resolve the lock again"))
    return out


def _entry(line: str, locked: dict[str, str]) -> tuple[str, str, str] | None:
    """(code, summary, hint) of what is wrong with one entry; a good one is added to ``locked``."""
    hint = "write name==version with --hash=sha256:..., as the resolver does"
    if _INDEX.search(line):
        return "DEPLOY-LOCK-INDEX", "the lock chooses where packages come from", "take the line out"
    if _ELSEWHERE.search(line.partition("--hash")[0].partition(" ;")[0]):
        return "DEPLOY-LOCK-URL", "the lock takes a package from outside the index", hint
    match = _PINNED.fullmatch(line)
    if match is None:
        return "DEPLOY-LOCK-UNPINNED", f"{display(line)} is not pinned to one version", hint
    if not _HASH.search(match["rest"]):
        return "DEPLOY-LOCK-NO-HASH", f"{display(match['name'])} has no SHA-256 hash", hint
    locked[normalised(match["name"])] = match["version"]
    return None


def _logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """(first line number, entry) with continuations joined and comments dropped."""
    held, start = "", 0
    for number, raw in enumerate(text.splitlines(), 1):
        line = re.sub(r"(?:^|\s)#.*$", "", raw).rstrip()
        start = start or number
        if line.endswith("\\"):
            held += line[:-1] + " "
            continue
        entry = (held + line).strip()
        if entry:
            yield start, entry
        held, start = "", 0
    if held.strip():
        yield start, held.strip()
