"""The problems of one manifest, gathered with their lines, sorted, bounded, and free of secrets.

Lines are attached only at the end: a secret found late must also be masked in a problem that was found early.
"""

from pathlib import Path

from octoform.base.files import head
from octoform.diagnostics import Diagnostic, Severity, Span, did_you_mean
from octoform.manifest import credentials
from octoform.manifest.model import FILE_NAME
from octoform.manifest.yaml_tree import Loc
from octoform.patterns import regex
from octoform.records import replace

MAX_PROBLEMS = 30
MAX_LINE = 500
MAX_VALUE = 60


class ProblemList:
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
            for start, end in (*credentials.found_in(line), *credentials.assigned_in(line)):
                self.mask(Span(number, start + 1, end + 1))
        for first, last in credentials.key_blocks(self.lines):
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
        """A value of the file as it may be in a message: on one line, bounded, secrets masked."""
        text = " ".join(credentials.masked(str(value)).split())
        return text if len(text) <= MAX_VALUE else text[: MAX_VALUE - 3] + "..."

    def diagnostics(self) -> list[Diagnostic]:
        """Everything found, by place; of more than `MAX_PROBLEMS` the first ones and the count of the rest."""
        ordered = sorted(self._found, key=_place)
        shown = [replace(item, source=self.source(item.span)) for item in ordered[:MAX_PROBLEMS]]
        if len(ordered) > MAX_PROBLEMS:
            rest, span = (
                f"{len(ordered) - MAX_PROBLEMS} more problems begin here and are not shown",
                ordered[MAX_PROBLEMS].span,
            )
            hint = "fix those above first"
            shown.append(Diagnostic(Severity.ERROR, "MANIFEST-MORE", rest, path=self.path, span=span, hint=hint))
        return shown

    def source(self, span: Span | None) -> str | None:
        """The line of a place as it may be shown, once everything has been read; None where it shows nothing."""
        if span is None or not self._line(span.line) or len(self._line(span.line)) > MAX_LINE:
            return None
        text = self._line(span.line)
        for start, end in self._masks.get(span.line, ()):
            text = text[:start] + "*" * (min(end, len(text)) - start) + text[end:]
        return text

    def _line(self, number: int) -> str:
        return self.lines[number - 1] if 0 < number <= len(self.lines) else ""


def _place(item: Diagnostic) -> tuple[int, int]:
    return (item.span.line, item.span.column) if item.span else (0, 0)


# From the bytes of a file to text that is worth parsing.
#
# The YAML reader is slow on purpose-made input and words its errors for programmers, so size, encoding and characters
# are settled here first. What is accepted: UTF-8, with or without a byte order mark, with LF, CRLF or CR line ends.

LIMIT = 256 * 1024
_UTF8_BOM = b"\xef\xbb\xbf"
_UTF16_BOMS = (b"\xff\xfe", b"\xfe\xff")
# Control characters except tab and line feed, separators that editors disagree about, characters that change the
# direction of what is displayed, and code points that are no characters.
FORBIDDEN = regex("[\x00-\x08\x0b-\x1f\x7f-\x9f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff\ufffe\uffff]")
_MAX_CHARACTERS = 10


def text_of(content: bytes, report: ProblemList) -> str | None:
    """The text of a file's bytes with LF line ends, or None with the reasons in the report."""
    text = _decode(content, report)
    if text is None:
        return None
    report.read(text)
    found = list(FORBIDDEN.finditer(text))
    for match in found[:_MAX_CHARACTERS]:
        line, column = _line_and_column(text, match.start())
        report.error(
            "MANIFEST-CONTROL-CHARACTER",
            f"the character {name_of(match.group())} may not be in a manifest",
            Span(line, column, column + 1),
            hint="delete it; inside a quoted text write an escape such as \\t if you really mean one",
        )
    return None if found else text


def name_of(char: str) -> str:
    """A character as ``U+0007``."""
    return f"U+{ord(char):04X}"


def read(path: Path, report: ProblemList) -> bytes | None:
    """The bytes of the manifest, or None with the reason in the report."""
    try:
        content, size = head(path, LIMIT + 1, follow=True), path.stat().st_size
    except FileNotFoundError:
        report.error("MANIFEST-NOT-FOUND", f"there is no {path.name} here", hint=_where_else(path))
        return None
    except OSError as problem:
        cure = "replace it by a text file"
        if isinstance(problem, PermissionError):
            cure = "ask its owner for the right to read it, and to look into its folder"
        summary = f"the manifest cannot be read: {problem.strerror or problem}"
        report.error("MANIFEST-UNREADABLE", summary, hint=f"`ls -l {path.name}` shows what it is; {cure}")
        return None
    if len(content) > LIMIT:
        report.error(
            "MANIFEST-TOO-LARGE",
            f"the manifest has {size} bytes; at most {LIMIT} are read",
            hint="a manifest names settings; devices are found, not listed",
        )
        return None
    return content


def _where_else(path: Path) -> str:
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.suffix in (".yml", ".yaml")]
    except OSError:
        names = []
    near = did_you_mean(path.name, names)
    if near:
        return f"{near} is here: rename it to {path.name}"
    return f"`octoform init` writes an {FILE_NAME} for this host"


def _decode(content: bytes, report: ProblemList) -> str | None:
    if content.startswith(_UTF16_BOMS) or _looks_wide(content):
        report.error(
            "MANIFEST-ENCODING",
            "the manifest is in UTF-16 or UTF-32",
            hint="save it as UTF-8",
        )
        return None
    content = content.removeprefix(_UTF8_BOM).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as problem:
        start = content.rfind(b"\n", 0, problem.start) + 1
        line = content.count(b"\n", 0, problem.start) + 1
        column = len(content[start : problem.start].decode("utf-8")) + 1
        report.read(content.decode("utf-8", "replace"))
        report.error(
            "MANIFEST-ENCODING",
            f"the byte 0x{content[problem.start]:02x} is not UTF-8",
            Span(line, column, column + 1),
            hint="save the file as UTF-8; an editor may have used Latin-1 or Windows-1252",
        )
        return None


def _looks_wide(content: bytes) -> bool:
    """Every second byte of ASCII text in UTF-16 is zero."""
    head = content[:64]
    return len(head) >= 4 and (not any(head[::2]) or not any(head[1::2]))


def _line_and_column(text: str, offset: int) -> tuple[int, int]:
    return text.count("\n", 0, offset) + 1, offset - text.rfind("\n", 0, offset)
