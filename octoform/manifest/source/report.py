"""The problems of one manifest, gathered with their lines, sorted, bounded, and free of secrets.

Lines are attached only at the end: a secret found late must also be masked in a problem that was found early.
"""

from dataclasses import replace

from octoform.diagnostics import Diagnostic, Severity, Span
from octoform.manifest import secrets
from octoform.manifest.source.tree import Loc

MOST = 30
LONGEST_LINE = 500
LONGEST_VALUE = 60


class Report:
    """Collects diagnostics about one file; ``path`` is shown as it is given."""

    def __init__(self, path: str) -> None:
        self.path = path
        self.lines: list[str] = []
        self._found: list[Diagnostic] = []
        self._masks: dict[int, list[tuple[int, int]]] = {}
        self._settled: set[Loc] = set()

    @property
    def failed(self) -> bool:
        """True as soon as one error was found."""
        return any(item.severity is Severity.ERROR for item in self._found)

    def read(self, text: str) -> None:
        """Take the lines of the file, and mask what looks like a secret in them."""
        self.lines = text.split("\n")
        for number, line in enumerate(self.lines, 1):
            for start, end in (*secrets.found_in(line), *secrets.assigned_in(line)):
                self.mask(Span(number, start + 1, end + 1))
        for first, last in secrets.key_blocks(self.lines):
            for number in range(first, last + 1):
                self.mask(Span(number + 1, 1, None))

    def mask(self, span: Span) -> None:
        """Never show this place; without an end column, from the column to the end of the line."""
        end = span.end_column - 1 if span.end_column is not None else len(self._line(span.line))
        self._masks.setdefault(span.line, []).append((span.column - 1, end))

    def settle(self, loc: Loc) -> None:
        """Say that the value at ``loc`` has been refused, so that no rule looks at it again."""
        self._settled.add(loc)

    def is_settled(self, loc: Loc) -> bool:
        """True for a value that has been refused already."""
        return loc in self._settled

    def error(self, code: str, summary: str, span: Span | None = None, **more: str | None) -> None:
        """Note an error; ``more`` may hold ``hint`` and ``detail``."""
        self._add(Severity.ERROR, code, summary, span, more)

    def warning(self, code: str, summary: str, span: Span | None = None, **more: str | None) -> None:
        """Note a warning; ``more`` may hold ``hint`` and ``detail``."""
        self._add(Severity.WARNING, code, summary, span, more)

    def _add(self, severity: Severity, code: str, summary: str, span: Span | None, more: dict[str, str | None]) -> None:
        self._found.append(Diagnostic(severity, code, summary, path=self.path, span=span, **more))

    @staticmethod
    def shown(value: object) -> str:
        """A value of the file as it may stand in a message: on one line, bounded, secrets masked."""
        text = " ".join(secrets.masked(str(value)).split())
        return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 3] + "..."

    def diagnostics(self) -> list[Diagnostic]:
        """Everything found, by place; of more than `MOST` the first ones and the count of the rest."""
        ordered = sorted(self._found, key=_place)
        shown = [replace(item, source=self.source(item.span)) for item in ordered[:MOST]]
        if len(ordered) > MOST:
            rest, span = f"{len(ordered) - MOST} more problems begin here and are not shown", ordered[MOST].span
            hint = "mend those above first"
            shown.append(Diagnostic(Severity.ERROR, "MANIFEST-MORE", rest, path=self.path, span=span, hint=hint))
        return shown

    def source(self, span: Span | None) -> str | None:
        """The line of a place as it may be shown, once everything has been read; None where it shows nothing."""
        if span is None or not self._line(span.line) or len(self._line(span.line)) > LONGEST_LINE:
            return None
        text = self._line(span.line)
        for start, end in self._masks.get(span.line, ()):
            text = text[:start] + "*" * (min(end, len(text)) - start) + text[end:]
        return text

    def _line(self, number: int) -> str:
        return self.lines[number - 1] if 0 < number <= len(self.lines) else ""


def _place(item: Diagnostic) -> tuple[int, int]:
    return (item.span.line, item.span.column) if item.span else (0, 0)
