"""The attempt's own copy of its spec: given, looked at afterwards, and kept where a person can promote it.

A retry may find that the fault lies in its instructions and correct them. The correction is the run's alone: the next
attempt of the same stage reads it, `protocol/` does not change, and only a person makes it permanent.
"""

import difflib
from collections.abc import Mapping
from pathlib import Path

from octoform.base import digest
from octoform.base.files import read_plain, replace
from octoform.records import dataclass
from octoform.redaction import redacted

FILE_NAME = "spec.md"
MAX_SPEC_BYTES = 256 * 1024
MAX_DIFF_LINES = 200


@dataclass(frozen=True, slots=True)
class Edit:
    """An agent's edit of its copy: the text, and the lines of a unified diff against what it was given."""

    text: str
    diff: tuple[str, ...]
    permitted: bool

    @property
    def digest(self) -> str:
        """The digest that a spec of this text has."""
        return digest.of_bytes(self.text.encode("utf-8"))

    @property
    def added(self) -> int:
        """Lines that are new."""
        return sum(1 for line in self.diff if line.startswith("+") and not line.startswith("+++"))

    @property
    def removed(self) -> int:
        """Lines that are gone."""
        return sum(1 for line in self.diff if line.startswith("-") and not line.startswith("---"))


def give(workdir: Path, text: str, *, editable: bool) -> Path:
    """Put the copy into an attempt's folder; one that may not be edited is read-only."""
    copy = workdir / FILE_NAME
    replace(copy, text.encode(), 0o644, synced=False)
    copy.chmod(0o644 if editable else 0o444)
    return copy


def look(workdir: Path, given: str, secrets: Mapping[str, str], *, permitted: bool) -> Edit | None:
    """The edit of the copy; None when it is unchanged, or is no plain file of a sane size.

    An edit is shown, kept and perhaps committed: the ``secrets``, by name, and what looks like one are redacted in it.
    """
    data = read_plain(workdir / FILE_NAME, MAX_SPEC_BYTES + 1)
    if data is None or len(data) > MAX_SPEC_BYTES:
        return None
    text = data.decode("utf-8", "replace")
    if text == given:
        return None
    text = redacted(text, secrets)
    return Edit(text, unified(given, text), permitted)


def unified(before: str, after: str) -> tuple[str, ...]:
    """The lines of a unified diff between two texts of a spec, bounded."""
    lines = list(difflib.unified_diff(before.splitlines(), after.splitlines(), "spec.md", "edited", lineterm="", n=2))
    more = len(lines) - MAX_DIFF_LINES
    return (*lines[:MAX_DIFF_LINES], f"({more} more lines)") if more > 0 else tuple(lines)
