"""Reading small files that an agent could have put there: plain, bounded, and never through a link."""

from pathlib import Path

from octoform.base.files import head


def read_plain(path: Path, limit: int) -> bytes | None:
    """The first ``limit`` bytes of a plain file; None when there is none, or it is a link, a folder or a pipe."""
    try:
        return head(path, limit)
    except OSError:
        return None
