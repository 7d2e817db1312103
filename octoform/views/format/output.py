"""Plain results: validation, schema, pages of codes, texts."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

import octoform
from octoform.base.clock import stamp
from octoform.base.escaping import escaped_json
from octoform.diagnostics import Diagnostic, has_errors, to_json
from octoform.patterns import regex
from octoform.views.format import problems
from octoform.views.format.console import Console, broken
from octoform.views.format.problems import summary

WIDEST = 100
"""Columns of a page, however wide the terminal is: longer lines are hard to read."""
_KEEPS_ITS_LINE = regex(r"[#|>\s]|[-*] |\d+\. ")


def validation(console: Console, found: Sequence[Diagnostic], *, as_json: bool) -> int:
    """All diagnostics and whether the project is valid; exit code 1 when it is not."""
    errors = sum(1 for item in found if item.severity == "error")
    if as_json:
        document = {
            "format": 1,
            "valid": errors == 0,
            "error_count": errors,
            "warning_count": len(found) - errors,
            "diagnostics": [to_json(problems.near(item)) for item in found],
        }
        console.raw(escaped_json(json.dumps(document, ensure_ascii=False, indent=2)))
    else:
        problems.show(console, found)
        if errors:
            console.problem(summary(found))
        else:
            console.line(console.paint("Success! The configuration is valid.", "green"))
    return 1 if has_errors(found) else 0


def document(console: Console, value: Mapping[str, object]) -> int:
    """A JSON document on standard output."""
    console.raw(escaped_json(json.dumps(value, ensure_ascii=False, indent=2)))
    return 0


def plain(console: Console, text: str) -> int:
    """A string as it is."""
    console.out.write(text)
    return 0


def page(console: Console, code: str, text: str, *, as_json: bool) -> int:
    """The page of a code; on a terminal as wide as that, else as it is written."""
    if as_json:
        return document(console, {"format": 1, "code": code, "page": text})
    return plain(console, _filled(text, min(console.width, WIDEST)) if console.out.isatty() else text)


def _filled(text: str, width: int) -> str:
    """A page with its paragraphs filled to ``width``: headings, lists, tables and code keep their lines."""
    import textwrap  # only a page on a terminal pays for it

    lines: list[str] = []
    paragraph: list[str] = []
    within_code = False
    for line in [*text.splitlines(), ""]:
        fence = line.startswith("```")
        if line and not (within_code or fence or _KEEPS_ITS_LINE.match(line)):
            paragraph.append(line)
            continue
        lines += textwrap.wrap(" ".join(paragraph), width, break_long_words=False, break_on_hyphens=False)
        paragraph = []
        lines.append(line if within_code else broken(line, width))
        within_code ^= fence
    return "\n".join(lines)


def codes(console: Console, names: Iterable[str], *, as_json: bool) -> int:
    """All codes, one a line."""
    names = sorted(names)
    if as_json:
        return document(console, {"format": 1, "codes": names})
    for name in names:
        console.line(name)
    return 0


def started(console: Console, path: Path, *, as_json: bool) -> int:
    """A new manifest was written."""
    if as_json:
        return document(console, {"format": 1, "written": str(path)})
    console.line(f"Wrote {path.name}. Read it, then:  octoform plan")
    return 0


# The JSON form of long operations: one object a line, versioned.
#
# The first line has type ``version``; a minor step of ``ui`` only adds, a major step may take away. Every line has
# ``@level``, ``@message``, ``@timestamp`` (RFC 3339, UTC) and ``type``; a reader that meets an unknown type shows
# its message.

UI_VERSION = "1.1"


def _now() -> datetime:
    return datetime.now(UTC)


class JsonStream:
    """Writes the lines; ``clock`` gives the time, UTC."""

    def __init__(self, console: Console, clock: Callable[[], datetime] = _now) -> None:
        self._console = console
        self._clock = clock
        self.emit("version", f"octoform {octoform.__version__}", octoform=octoform.__version__, ui=UI_VERSION)

    def emit(self, kind: str, message: str, *, level: str = "info", **fields: object) -> None:
        """One line of type ``kind``."""
        head: Mapping[str, object] = {
            "@level": level,
            "@message": message,
            "@timestamp": stamp(self._clock(), 3),
            "type": kind,
        }
        self._console.raw(escaped_json(json.dumps({**head, **fields}, ensure_ascii=False)))

    def diagnostics(self, items: list[Diagnostic] | tuple[Diagnostic, ...]) -> None:
        """One line of type ``diagnostic`` for each."""
        for item in items:
            level = "error" if item.severity == "error" else "warn"
            self.emit("diagnostic", f"{item.code}: {item.summary}", level=level, diagnostic=to_json(item))
