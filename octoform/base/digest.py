"""Canonical JSON and sha256: the one way two values are compared across machines, runs and versions.

Every key, every artifact digest and every saved plan rests on these functions, so their output may never change
for the same input: sorted keys, no blanks, UTF-8, no NaN.
"""

import hashlib
import json
from pathlib import Path

from octoform.base import files

PREFIX = "sha256:"


def canonical_json(value: object) -> bytes:
    """UTF-8 bytes of the one JSON text for ``value``; ValueError for NaN or infinity, TypeError for non-JSON."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
    return text.encode("utf-8", "surrogatepass")


def of_bytes(data: bytes) -> str:
    """``sha256:<64 hex digits>`` of the bytes as they are."""
    return PREFIX + hashlib.sha256(data).hexdigest()


def of_value(value: object) -> str:
    """Digest of a JSON value, independent of key order and white space."""
    return of_bytes(canonical_json(value))


def of_file(path: Path) -> str:
    """Digest of a file's bytes; OSError when it cannot be read."""
    return of_bytes(files.read(path))


def of_large_file(path: Path) -> str | None:
    """Digest of a regular file of any size, read piece by piece; None for what is none, or cannot be read."""
    try:
        with files.stream(path, follow=False) as file:
            return PREFIX + hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return None


def short(digest: str) -> str:
    """The first 12 hex digits, for people and for folder names."""
    return digest.removeprefix(PREFIX)[:12]
