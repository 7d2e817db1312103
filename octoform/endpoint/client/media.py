"""Pictures and sounds of a tool's answer as files: a terminal can show neither."""

import base64
import binascii
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.files import private_folder
from octoform.state.files import write_atomic

_MEDIA = ("image", "audio")
_ENDINGS = {"image/jpeg": "jpg", "image/png": "png", "audio/wav": "wav", "audio/x-wav": "wav"}


def ending_of(mime: str) -> str:
    """How the name of a file with such media ends, without the dot; ``bin`` for what is not known."""
    return _ENDINGS.get(mime, "bin")


def save_media(content: Iterable[Mapping[str, Any]], folder: Path, stem: str) -> tuple[list[Path], list[Diagnostic]]:
    """Write the pictures and sounds among the blocks as ``<stem>-<n>.<ending>`` (mode 0600); gives the files."""
    saved: list[Path] = []
    for block in content:
        if block.get("type") not in _MEDIA:
            continue
        try:
            data = base64.b64decode(block.get("data", ""), validate=True)
        except binascii.Error as fault:
            summary = "the answer holds media that are not base64"
            return saved, [error("ENDPOINT-OUTPUT-INVALID", summary, detail=str(fault))]
        path = private_folder(folder) / f"{stem}-{len(saved) + 1}.{ending_of(str(block.get('mimeType')))}"
        if problem := write_atomic(path, data, 0o600):
            return saved, [problem]
        saved.append(path)
    return saved, []
