"""A step of a build is done once: its stamp holds what it was made of, and another stamp makes it anew."""

import hashlib
import sys
import time
from collections.abc import Callable
from pathlib import Path

_STARTED = time.monotonic()


def once(folder: Path, name: str, made_of: str, make: Callable[[], None]) -> None:
    """Call ``make`` unless the step of this name was done with the same ``made_of``."""
    stamp, text = folder / f".made-{name}", hashlib.sha256(made_of.encode()).hexdigest()
    if stamp.exists() and stamp.read_text() == text:
        return
    stamp.unlink(missing_ok=True)
    print(f"{time.monotonic() - _STARTED:5.0f} s  {folder.name}: {name}", file=sys.stderr, flush=True)
    make()
    stamp.write_text(text)


def content(*paths: Path) -> str:
    """What files hold, for a stamp."""
    return "\n".join(path.read_text() for path in paths)
