"""Problems as a compiler shows them: what, where, the line with the place marked, and what to do.

The place is marked by a caret line, so it is not lost where colour is off. Everything that comes from a file, a device
or an agent is escaped and bounded here; only plain ASCII is added, so any terminal can show it. Beside them what ends a
command before it has any output: usage errors and interruption.
"""

import json
import signal
import unicodedata
from collections.abc import Iterable, Sequence
from pathlib import Path

import octoform
from octoform.base.escaping import escaped, escaped_json
from octoform.diagnostics import Diagnostic, Severity, Span, has_errors, to_json
from octoform.records import replace
from octoform.views.format.console import Console

MAX_USAGE = 600
"""Characters of a sentence about a command line, which repeats words of it."""
GOES_ON = "what was accepted stays accepted, the next apply goes on from there"
_STYLES = {"bold": "1", "dim": "2", "red": "1;31", "yellow": "1;33", "blue": "1;34", "cyan": "36"}
_SEVERITY = {Severity.ERROR: "red", Severity.WARNING: "yellow"}
WIDTH = 120
_TAB = "    "
_CELLS = {"\t": _TAB, "\n": "\\x0a"}
_CUT = "..."
_MAX_PARAGRAPH = 4000


def usage(console: Console, message: str, usage_line: str) -> int:
    """A command line that could not be understood; exit code 1."""
    text = escaped(message, keep="\n")
    console.problem(f"octoform: {text if len(text) <= MAX_USAGE else text[:MAX_USAGE] + '...'}")
    console.problem(usage_line.strip() or "see octoform --help")
    return 1


def renamed(console: Console, former: str, name: str) -> None:
    """A command was called by a name that the next version does not know."""
    console.problem(f"octoform: `octoform {former}` is now `octoform {name}`; the next version knows the new name only")


def interrupted(console: Console, text: str | None = None) -> int:
    """Ctrl-C; exit code 130. ``text`` is what that means for the work at hand, when not for an apply; empty: silent."""
    if text != "":
        console.problem(f"\noctoform: interrupted; {text or GOES_ON}")
    return 130


def stopped(console: Console, number: int, text: str | None = None) -> int:
    """Ended by a signal; exit code 128 and its number, as a shell has it; ``text`` as `interrupted`."""
    if text != "":
        console.problem(f"octoform: stopped by {signal.Signals(number).name}; {text or GOES_ON}")
    return 128 + number


def version(console: Console, *, as_json: bool = False) -> int:
    """The version; exit code 0."""
    plain = f"octoform {octoform.__version__}"
    console.raw(json.dumps({"format": 1, "version": octoform.__version__}) if as_json else plain)
    return 0


def near(item: Diagnostic) -> Diagnostic:
    """The diagnostic with its path as a person in this folder would type it."""
    if item.path is None or not Path(item.path).is_absolute() or not Path(item.path).is_relative_to(Path.cwd()):
        return item
    return replace(item, path=str(Path(item.path).relative_to(Path.cwd())))


def show(console: Console, items: Iterable[Diagnostic], *, as_json: bool = False) -> int:
    """Diagnostics to standard error (or one JSON object to standard output); exit code 1 when one is an error."""
    items = [near(item) for item in items]
    if as_json:
        document = {"format": 1, "diagnostics": [to_json(item) for item in items]}
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False)))
    elif items:
        for item in items:
            console.problem(render(item, colour=console.colour_err, width=console.width_err) + "\n")
    return 1 if has_errors(items) else 0


def render(item: Diagnostic, *, colour: bool, width: int = WIDTH) -> str:
    """The text of one diagnostic, several lines without a final line end; ``width`` bounds the shown source line."""
    paint = _Paint(colour)
    style = _SEVERITY[item.severity]
    head = f"{paint(f'{item.severity.value}[{_flat(item.code)}]', style)}{paint(': ' + _flat(item.summary), 'bold')}"
    gutter = len(str(item.span.line)) if item.span is not None else 1
    bar = " " * gutter + " " + paint("|", "blue")
    out = [head]
    place = _place(item)
    if place:
        out.append(" " * gutter + paint("-->", "blue") + " " + place)
    if item.span is not None and item.source is not None:
        text, caret = _marked(item.source, item.span, max(20, width - gutter - 3))
        number = paint(f"{item.span.line} |", "blue")
        out += [bar, f"{number} {text}".rstrip(), f"{bar} {paint(caret, style)}"]
    out += _paragraph(item.detail, " " * (gutter + 3))
    if item.hint:
        lead = " " * (gutter + 1) + paint("help:", "cyan") + " "
        lines = _lines(item.hint)
        out += [lead + lines[0], *(" " * (gutter + 7) + line for line in lines[1:])]
    return "\n".join(out)


def summary(items: Sequence[Diagnostic]) -> str:
    """``2 errors, 1 warning``."""
    errors = sum(item.severity is Severity.ERROR for item in items)
    counts = ((errors, "error"), (len(items) - errors, "warning"))
    return ", ".join(f"{count} {word}{'' if count == 1 else 's'}" for count, word in counts if count)


class _Paint:
    """Colours a string, or leaves it as it is."""

    def __init__(self, colour: bool) -> None:
        self._colour = colour

    def __call__(self, text: str, style: str) -> str:
        return f"\x1b[{_STYLES[style]}m{text}\x1b[0m" if self._colour and text else text


def _place(item: Diagnostic) -> str:
    """``file:line:column``, or ``file#/json/pointer``, or the file alone."""
    path = _flat(item.path) if item.path else ""
    if item.span is not None:
        return f"{path or 'line'}:{item.span.line}:{item.span.column}"
    pointer = _flat(item.pointer) if item.pointer else ""
    return f"{path}#{pointer}" if pointer else path


def _flat(text: str) -> str:
    return escaped(" ".join(text.split()))


def _lines(text: str) -> list[str]:
    bounded = text if len(text) <= _MAX_PARAGRAPH else text[:_MAX_PARAGRAPH] + _CUT
    return [escaped(line, "\t").replace("\t", _TAB).rstrip() for line in bounded.split("\n")]


def _paragraph(text: str | None, indent: str) -> list[str]:
    return [(indent + line).rstrip() for line in _lines(text)] if text else []


def _marked(source: str, span: Span, width: int) -> tuple[str, str]:
    """The source line as shown, cut to ``width`` columns around the place, and the line with the carets."""
    cells = [_CELLS.get(char) or escaped(char) for char in source]
    start = min(max(span.column - 1, 0), len(cells))
    end = min(
        max(span.end_column - 1 if span.end_column is not None else start + 1, start + 1), max(len(cells), start + 1)
    )
    first, last = _window(cells, start, end, width)
    left = _CUT if first else ""
    right = _CUT if last < len(cells) else ""
    shown = left + "".join(cells[first:last]) + right
    before = len(left) + _columns("".join(cells[first:start]))
    marked = max(1, _columns("".join(cells[start : min(end, last)])))
    return shown, " " * before + "^" * marked


def _window(cells: list[str], start: int, end: int, width: int) -> tuple[int, int]:
    """Which cells are shown: all where they fit, otherwise some before the place and as many as fit after it."""
    if sum(map(_columns, cells)) <= width:
        return 0, len(cells)
    room = width - 2 * len(_CUT)
    wanted = max(room // 3, room - sum(map(_columns, cells[start:end])))
    first = start
    used = 0
    while first > 0 and used + _columns(cells[first - 1]) <= min(wanted, room // 2):
        first -= 1
        used += _columns(cells[first])
    last = start
    while last < len(cells) and used + _columns(cells[last]) <= room:
        used += _columns(cells[last])
        last += 1
    return first, last


def _columns(text: str) -> int:
    """How many columns of a terminal a string takes."""
    return sum(_width(char) for char in text)


def _width(char: str) -> int:
    if unicodedata.combining(char) or unicodedata.category(char) in ("Mn", "Me"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in ("W", "F") else 1
