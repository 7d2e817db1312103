"""Problems as values: severity, stable code, place, hint; and the few ways to make one.

A function that can meet a user's mistake returns ``(result, diagnostics)`` and gathers all of them; only bugs
raise. Rendering is the views' business: nothing here prints.

Each code has its long story: one page of prose in the folder ``pages`` beside this module, which ``octoform explain
CODE`` prints. The pages are files so that writing one needs no code, and so that a test can hold codes and pages
against each other.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum

from octoform.base.escaping import escape_of
from octoform.records import dataclass, replace

UNTRUSTED_CERTIFICATE = (
    "put the authority's certificate (of a proxy that inspects TLS: the proxy's) into the system's store, "
    "or name its file in SSL_CERT_FILE"
)
"""The hint where a program does not trust the other side's certificate."""
_UNTRUSTED = r"(?i)certificate[ _]verify[ _]failed|UnknownIssuer|UNABLE_TO_\w*(SIGNATURE|ISSUER)|SELF_SIGNED_CERT"
_CODE = r"[A-Z][A-Z0-9]*(?:-[A-Z0-9]+)+"


class Severity(StrEnum):
    """An error stops the operation; a warning is shown and does not."""

    ERROR = "error"
    WARNING = "warning"


@dataclass(frozen=True, slots=True)
class Span:
    """A place in a text file. Lines and columns count from 1; columns count characters, not bytes."""

    line: int
    column: int
    end_column: int | None = None


@dataclass(frozen=True, slots=True)
class Diagnostic:
    """One problem.

    ``code`` is stable and has a page (``octoform explain CODE``). ``path`` is the file concerned, as the user would
    type it. A text file has ``span`` and ``source`` (the offending line, without its line end); a JSON artifact has
    ``pointer`` (RFC 6901). ``detail`` may hold several lines; ``hint`` is one sentence that states what to do.
    """

    severity: Severity
    code: str
    summary: str
    path: str | None = None
    span: Span | None = None
    source: str | None = None
    pointer: str | None = None
    detail: str | None = None
    hint: str | None = None


def error(code: str, summary: str, **where: object) -> Diagnostic:
    """An error diagnostic; keywords are the optional fields of `Diagnostic`."""
    return _made(Severity.ERROR, code, summary, where)


def warning(code: str, summary: str, **where: object) -> Diagnostic:
    """A warning diagnostic; keywords are the optional fields of `Diagnostic`."""
    return _made(Severity.WARNING, code, summary, where)


def _made(severity: Severity, code: str, summary: str, where: Mapping[str, object]) -> Diagnostic:
    """With names of files that are no text (surrogateescape, PEP 383) as text, which every output can hold."""
    fields = {name: _text(value) if isinstance(value, str) else value for name, value in where.items()}
    return Diagnostic(severity, code, _text(summary), **fields)  # type: ignore[arg-type]


def _text(text: str) -> str:
    if text.isascii():
        return text
    return "".join(escape_of(letter) if "\ud800" <= letter <= "\udfff" else letter for letter in text)


def as_warning(item: Diagnostic) -> Diagnostic:
    """The same, where it is not in the way yet."""
    return replace(item, severity=Severity.WARNING)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """True when at least one of them is an error."""
    return any(item.severity is Severity.ERROR for item in diagnostics)


def to_json(item: Diagnostic) -> dict[str, object]:
    """The JSON form used by every ``--json`` output; absent fields are omitted."""
    out: dict[str, object] = {"severity": item.severity.value, "code": item.code, "summary": item.summary}
    if item.span is not None:
        place: dict[str, object] = {"line": item.span.line, "column": item.span.column}
        if item.span.end_column is not None:
            place["end_column"] = item.span.end_column
        out["range"] = place
    for name in ("path", "source", "pointer", "detail", "hint"):
        value = getattr(item, name)
        if value is not None:
            out[name] = value
    return out


def from_json(value: Mapping[str, object]) -> Diagnostic:
    """The diagnostic of a JSON form; what is missing or of another kind is omitted, so any object gives one."""
    place = value.get("range")
    span = None
    if isinstance(place, dict) and isinstance(place.get("line"), int) and isinstance(place.get("column"), int):
        end = place.get("end_column")
        span = Span(place["line"], place["column"], end if isinstance(end, int) else None)
    words = {name: value[name] for name in ("path", "source", "pointer", "detail", "hint") if name in value}
    return Diagnostic(
        Severity.WARNING if value.get("severity") == Severity.WARNING.value else Severity.ERROR,
        str(value.get("code", "")),
        str(value.get("summary", "")),
        span=span,
        **{name: word for name, word in words.items() if isinstance(word, str)},
    )


def did_you_mean(word: str, candidates: Sequence[str]) -> str | None:
    """The candidate that ``word`` is a slip or the beginning of; None where none is near.

    A slip is a letter or two that is another one, omitted, added or swapped.

    Another number is no slip (who writes ``usb-1f00-0002`` does not mean ``usb-1f00-0001``), but for swapped digits.
    """
    most = max(1, min(3, len(word) // 4))
    near = [(_slips(word.casefold(), item.casefold(), most), item) for item in candidates]
    found = min((pair for pair in near if pair[0] <= most), default=None, key=lambda pair: pair[0])
    begun = [item for item in candidates if len(word) > 2 and item.casefold().startswith(word.casefold())]
    if found is None and len(begun) == 1:
        return begun[0]
    if found is None or (
        _unnumbered(word) == _unnumbered(found[1]) and sorted(word.casefold()) != sorted(found[1].casefold())
    ):
        return None
    return found[1]


def _unnumbered(word: str) -> str:
    return "".join("0" if letter.isdigit() else letter for letter in word.casefold())


def _slips(one: str, other: str, most: int) -> int:
    """How many slips make one word of the other (optimal string alignment); more than ``most`` where it is more."""
    if abs(len(one) - len(other)) > most:
        return most + 1
    before: list[int] = []
    row = list(range(len(other) + 1))
    for at, letter in enumerate(one, 1):
        earlier, before, row = before, row, [at]
        for to, wanted in enumerate(other, 1):
            best = min(before[to] + 1, row[to - 1] + 1, before[to - 1] + (letter != wanted))
            swapped = at > 1 and to > 1 and letter == other[to - 2] and one[at - 2] == wanted
            row.append(min(best, earlier[to - 2] + 1) if swapped else best)
        if min(row) > most:
            return most + 1
    return row[-1]


def is_untrusted_certificate(text: str) -> bool:
    """True when a program's words say that it does not trust the other side's certificate."""
    return re.search(_UNTRUSTED, text) is not None


def page_of(code: str) -> str | None:
    """The page of a code in markdown, its first line ``# CODE: title``; None when there is no such code.

    Letter case and surrounding blanks do not matter.
    """
    from importlib import resources  # only where a page is asked for

    wanted = code.strip().upper()
    page = f"{wanted}.md"
    return resources.files(__name__).joinpath("pages", page).read_text("utf-8") if wanted in codes() else None


def codes() -> list[str]:
    """Every code that has a page, in alphabetical order."""
    from importlib import resources

    pages = (resources.files(__name__) / "pages").iterdir()
    names = [entry.name.removesuffix(".md") for entry in pages if entry.name.endswith(".md")]
    return sorted(name for name in names if re.fullmatch(_CODE, name))


def unknown_code(code: str) -> Diagnostic:
    """EXPLAIN-UNKNOWN-CODE, with the nearest code as a hint."""
    near = did_you_mean(code.strip().upper(), codes())
    hint = f"did you mean {near}?" if near else "`octoform explain` without a code lists all of them"
    return error("EXPLAIN-UNKNOWN-CODE", f"there is no page for {code!r}", hint=hint)
