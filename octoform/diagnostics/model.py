"""The diagnostic value and the few ways to make one."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum


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
    ``pointer`` (RFC 6901). ``detail`` may hold several lines; ``hint`` is one sentence that says what to do.
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
    return Diagnostic(Severity.ERROR, code, summary, **where)  # type: ignore[arg-type]


def warning(code: str, summary: str, **where: object) -> Diagnostic:
    """A warning diagnostic; keywords are the optional fields of `Diagnostic`."""
    return Diagnostic(Severity.WARNING, code, summary, **where)  # type: ignore[arg-type]


def as_warning(item: Diagnostic) -> Diagnostic:
    """The same, where it does not stand in the way yet."""
    return replace(item, severity=Severity.WARNING)


def has_errors(diagnostics: Iterable[Diagnostic]) -> bool:
    """True when at least one of them is an error."""
    return any(item.severity is Severity.ERROR for item in diagnostics)


def to_json(item: Diagnostic) -> dict[str, object]:
    """The JSON form used by every ``--json`` output; absent fields are left out."""
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
    """The diagnostic of a JSON form; what is missing or of another kind is left out, so any object gives one."""
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
    """The candidate that ``word`` most likely is a slip of, or None."""
    import difflib  # only a mistake pays for it

    found = difflib.get_close_matches(word, list(candidates), n=1, cutoff=0.6)
    return found[0] if found else None
