"""The daemon's lines in the host's one execution log, beside those of the tools and of octoform's own runs. Light."""

import json
import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import write_all


def append(path: Path, lines: Iterable[Mapping[str, Any]]) -> OSError | None:
    """Write each object as one line; what kept them from being written, None when they stand.

    All of them in one write to a file opened for appending, so that they never mix with lines of a tool.
    """
    data = b"".join(json.dumps(line, ensure_ascii=True).encode("ascii") + b"\n" for line in lines)
    try:
        # Not blocking: with a pipe in its place the daemon would wait for a reader.
        how = os.O_WRONLY | os.O_APPEND | os.O_CREAT | os.O_NONBLOCK | os.O_CLOEXEC
        descriptor = os.open(path, how, 0o600)
        try:
            write_all(descriptor, data)
        finally:
            os.close(descriptor)
    except OSError as problem:
        return problem
    return None
