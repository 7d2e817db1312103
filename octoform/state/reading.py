"""Files that are read again and again for as long as a daemon lives: whatever stands in their place holds nobody up.

A pipe would be waited for without end, and JSON that is nested without end is no `ValueError` by itself. Light.
"""

import errno
import json
import os
import stat
from pathlib import Path
from typing import Any


def bytes_of(path: Path) -> bytes:
    """The bytes of a regular file, links followed; OSError for what is none, which is never waited for."""
    descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(errno.EINVAL, "it is no regular file", str(path))
        with os.fdopen(descriptor, "rb", closefd=False) as file:
            return file.read()
    finally:
        os.close(descriptor)


def json_of(path: Path) -> Any:
    """The JSON document of a file; OSError as `bytes_of`, ValueError for all that is no document."""
    data = bytes_of(path)
    try:
        return json.loads(data)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
