"""What the YAML reader complains about, in words for the person who wrote the file. (Heavy: the reader's errors.)"""

import re

from ruamel.yaml.error import MarkedYAMLError

from octoform.diagnostics import Span
from octoform.manifest.source.report import Report

_INDENTATION = re.compile(r"[ ]*\t")

# Part of the reader's message -> what it means here, and what to do.
_WORDS: tuple[tuple[str, str, str], ...] = (
    (
        "mapping values are not allowed",
        "a second `: ` on one line, or a line that is indented too far",
        "line the keys up, or quote a text that holds `: `",
    ),
    ("unexpected end of stream", "a quote is opened and never closed", "close the quote"),
    ("found unexpected document separator", "a quote is opened and never closed", "close the quote"),
    ("expected ',' or '}'", "a `{` is opened and never closed", "close the brace, or put a comma between its entries"),
    ("expected ',' or ']'", "a `[` is opened and never closed", "close the bracket, or put a comma between its items"),
    ("expected <block end>", "this line does not line up with the lines above it", "check the indentation"),
    ("could not find expected ':'", "a key without its colon", "write `key: value`, with a blank after the colon"),
    ("that cannot start any token", "this character cannot start a value", "quote the text"),
    ("unknown escape character", "this escape is not known", "write the backslash twice, or use single quotes"),
    ("expected escape sequence", "this escape is not complete", "write the backslash twice, or use single quotes"),
    ("block sequence entries are not allowed", "a list cannot begin here", "start the list on its own line"),
    ("sequence entries are not allowed", "a list cannot begin here", "start the list on its own line"),
    ("expected '<document start>'", "the text goes on after its end", "write lines of the form `key: value`"),
    ("expected the node content", "a value is missing here", "give a value, or remove the sign"),
)
_OTHERWISE = "octopus.yaml is YAML 1.2: lines of the form `key: value`"
_WHERE_IT_BEGAN = (
    "could not find expected ':'",
    "unexpected end of stream",
    "found unexpected document separator",
    "expected ',' or",
)


def explain(problem: MarkedYAMLError, report: Report) -> None:
    """Report a problem of syntax, at the place where a person would mend it."""
    words = str(problem.problem or problem.context or "it cannot be read")
    mark = problem.problem_mark or problem.context_mark
    if problem.context_mark is not None and any(part in words for part in _WHERE_IT_BEGAN):
        mark = problem.context_mark
    line, column = (mark.line + 1, mark.column + 1) if mark is not None else (1, 1)
    if _is_tab(report, line, column):
        report.error(
            "MANIFEST-TAB",
            "a tab cannot indent YAML",
            Span(line, column, column + 1),
            hint="indent with spaces, two for each level",
        )
        return
    meaning, hint = next(((meaning, hint) for part, meaning, hint in _WORDS if part in words), (words, _OTHERWISE))
    report.error("MANIFEST-SYNTAX", f"not valid YAML: {meaning}", Span(line, column), hint=hint)


def _is_tab(report: Report, line: int, column: int) -> bool:
    text = report.lines[line - 1] if line <= len(report.lines) else ""
    return text[column - 1 : column] == "\t" or _INDENTATION.match(text) is not None
