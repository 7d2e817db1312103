"""YAML text to a positioned tree, within bounds. (Heavy: imports the YAML reader.)

Only the reader's event stream is used. It comes piece by piece, so depth and size are bounded while reading; nothing
is constructed, so no tag can run anything; and anchors, aliases, merge keys and tags, which a short file of settings
does not need, are refused where they stand instead of being expanded.
"""

from dataclasses import dataclass, field

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, StringMark, YAMLError
from ruamel.yaml.events import (
    AliasEvent,
    CollectionStartEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
)

from octoform.diagnostics import Span
from octoform.manifest.problem_list import FORBIDDEN, ProblemList, name_of
from octoform.manifest.yaml_tree import Items, Node, Scalar, Table, plain_value
from octoform.patterns import regex

# What the YAML reader complains about, in words for the person who wrote the file. (Heavy: the reader's errors.)

_INDENTATION = regex(r"[ ]*\t")

# Part of the reader's message -> what it means here, and what to do.
_WORDS: tuple[tuple[str, str, str], ...] = (
    (
        "mapping values are not allowed",
        "a second `: ` on one line, or a line that is indented too far",
        "line the keys up, or quote a string that holds `: `",
    ),
    ("unexpected end of stream", "a quote is opened and never closed", "close the quote"),
    ("found unexpected document separator", "a quote is opened and never closed", "close the quote"),
    ("expected ',' or '}'", "a `{` is opened and never closed", "close the brace, or put a comma between its entries"),
    ("expected ',' or ']'", "a `[` is opened and never closed", "close the bracket, or put a comma between its items"),
    ("expected <block end>", "this line does not line up with the lines above it", "check the indentation"),
    ("could not find expected ':'", "a key without its colon", "write `key: value`, with a blank after the colon"),
    ("that cannot start any token", "this character cannot start a value", "quote the string"),
    ("unknown escape character", "this escape is not known", "write the backslash twice, or use single quotes"),
    ("expected escape sequence", "this escape is not complete", "write the backslash twice, or use single quotes"),
    ("block sequence entries are not allowed", "a list cannot begin here", "start the list on its own line"),
    ("sequence entries are not allowed", "a list cannot begin here", "start the list on its own line"),
    ("expected '<document start>'", "the string goes on after its end", "write lines of the form `key: value`"),
    ("expected the node content", "a value is missing here", "give a value, or remove the sign"),
)
_OTHERWISE = "octopus.yaml is YAML 1.2: lines of the form `key: value`"
_WHERE_IT_BEGAN = (
    "could not find expected ':'",
    "unexpected end of stream",
    "found unexpected document separator",
    "expected ',' or",
)


def explain(problem: MarkedYAMLError, report: ProblemList) -> None:
    """Report a problem of syntax, at the place where a person would fix it."""
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


def _is_tab(report: ProblemList, line: int, column: int) -> bool:
    text = report.lines[line - 1] if line <= len(report.lines) else ""
    return text[column - 1 : column] == "\t" or _INDENTATION.match(text) is not None


MAX_DEPTH = 12
MAX_VALUES = 5000


def read_tree(text: str, report: ProblemList) -> Table | None:
    """The manifest's top mapping, or None with the reasons in the report; a problem of syntax ends the reading."""
    builder = _Builder(report)
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            if not builder.take(event):
                return None
    except MarkedYAMLError as problem:
        explain(problem, report)
        return None
    except (YAMLError, ValueError, OverflowError):
        # The reader passes the number of an escape to chr() unchecked.
        report.error(
            "MANIFEST-SYNTAX",
            "not valid YAML: an escape in the next text is no character",
            builder.last,
            hint="write the backslash twice, or use single quotes",
        )
        return None
    return _top(builder, report)


def _top(builder: "_Builder", report: ProblemList) -> Table | None:
    root = builder.root
    if isinstance(root, Table) and root.entries:
        return root
    if root is None or (isinstance(root, Scalar) and root.value is None) or isinstance(root, Table):
        report.error("MANIFEST-EMPTY", "the manifest is empty", hint="the least that is needed is `version: 1`")
        return None
    what = "a list" if isinstance(root, Items) else "a single value"
    report.error(
        "MANIFEST-NOT-A-MAPPING",
        f"the manifest is {what}; it must be a mapping of settings",
        root.span,
        hint="write lines of the form `key: value`, starting with `version: 1`",
    )
    return None


@dataclass(slots=True)
class _Frame:
    """A mapping or list that is still being read."""

    span: Span
    is_mapping: bool
    entries: list[tuple[Scalar, Node]] = field(default_factory=list)
    items: list[Node] = field(default_factory=list)
    key: Scalar | None = None
    waits_for_value: bool = False


class _Builder:
    """Makes a tree of events; reports what it refuses."""

    def __init__(self, report: ProblemList) -> None:
        self._report = report
        self._stack: list[_Frame] = []
        self._values = 0
        self._documents = 0
        self.root: Node | None = None
        self.last: Span | None = None

    def take(self, event: Event) -> bool:
        """Add an event; False when reading must stop."""
        self.last = _span(event)
        if isinstance(event, DocumentStartEvent):
            return self._document(event)
        if isinstance(event, NodeEvent):
            return self._node(event)
        if isinstance(event, MappingEndEvent | SequenceEndEvent):
            frame = self._stack.pop()
            done: Node
            if frame.is_mapping:
                done = Table(frame.span, tuple(frame.entries))
            else:
                done = Items(frame.span, tuple(frame.items))
            self._place(done)
        return True

    def _document(self, event: DocumentStartEvent) -> bool:
        self._documents += 1
        if self._documents > 1:
            self._report.error(
                "MANIFEST-DOCUMENTS",
                "the file holds more than one YAML document",
                self.last,
                hint="remove this `---` and what follows it; a second host has its own folder and manifest",
            )
            return False
        if event.version not in (None, (1, 2)):
            self._report.error("MANIFEST-SYNTAX", "the manifest is YAML 1.2", Span(1, 1), hint="remove `%YAML`")
            return False
        return True

    def _node(self, event: NodeEvent) -> bool:
        span = _span(event)
        self._values += 1
        if self._values > MAX_VALUES or len(self._stack) >= MAX_DEPTH:
            what = f"more than {MAX_VALUES} values" if self._values > MAX_VALUES else f"more than {MAX_DEPTH} levels"
            hint = "a manifest is a short file of settings; devices are found, not listed"
            self._report.error("MANIFEST-TOO-LARGE", f"the manifest has {what}", span, hint=hint)
            return False
        if self._refused(event, span):
            return False
        if isinstance(event, ScalarEvent):
            text = self._characters(event.value, span)
            plain = event.style is None
            value = plain_value(text) if plain else text
            self._place(Scalar(span, text, value, plain, _last_line(event)))
        else:
            self._stack.append(_Frame(span, isinstance(event, MappingStartEvent)))
        return True

    def _refused(self, event: NodeEvent, span: Span) -> bool:
        """Report an anchor, an alias or a tag: what it would mean for the rest is not guessed at."""
        if event.anchor is not None:
            mark = "*" if isinstance(event, AliasEvent) else "&"
            self._report.error(
                "MANIFEST-ANCHOR",
                f"anchors and aliases are not used in a manifest: {mark}{self._report.shown(event.anchor)}",
                span,
                hint="write the value out where it is needed"
                + ("; quote a string that begins with *" if isinstance(event, AliasEvent) else ""),
            )
            return True
        tag = str(event.tag or "") if isinstance(event, ScalarEvent | CollectionStartEvent) else ""
        if tag:
            shown = self._report.shown(tag.replace("tag:yaml.org,2002:", "!!"))
            self._report.error(
                "MANIFEST-TAG",
                f"tags are not used in a manifest: {shown}",
                span,
                hint="remove the tag; every setting has one type, which is known",
            )
        return bool(tag)

    def _characters(self, text: str, span: Span) -> str:
        """The text without characters that no setting may hold; they are reported."""
        found = FORBIDDEN.search(text)
        if found:
            self._report.error(
                "MANIFEST-CONTROL-CHARACTER",
                f"an escape is written for the character {name_of(found.group())}, which no setting may hold",
                span,
                hint="remove the escape",
            )
        return FORBIDDEN.sub("", text)

    def _place(self, node: Node) -> None:
        if not self._stack:
            self.root = node
            return
        frame = self._stack[-1]
        if not frame.is_mapping:
            frame.items.append(node)
        elif not frame.waits_for_value:
            frame.key, frame.waits_for_value = self._key(node, frame), True
        else:
            if frame.key is not None:
                frame.entries.append((frame.key, node))
            frame.key, frame.waits_for_value = None, False

    def _key(self, node: Node, frame: _Frame) -> Scalar | None:
        """The node as a key, or None when its entry is dropped because the key was refused."""
        if not isinstance(node, Scalar) or not node.text:
            self._report.error("MANIFEST-BAD-KEY", "a key must be a word", node.span, hint="write `key: value`")
            return None
        if node.plain and node.text == "<<":
            self._report.error(
                "MANIFEST-ANCHOR",
                "merge keys are not used in a manifest",
                node.span,
                hint="write the settings out where they are needed",
            )
            return None
        earlier = next((key for key, _ in frame.entries if key.text == node.text), None)
        if earlier is not None:
            self._report.error(
                "MANIFEST-DUPLICATE-KEY",
                f"the key `{self._report.shown(node.text)}` occurs twice",
                node.span,
                detail=f"it was first given on line {earlier.span.line}",
                hint="keep one of the two",
            )
            return None
        return node


def _span(event: Event) -> Span:
    start: StringMark = event.start_mark
    end: StringMark = event.end_mark
    same_line = end.line == start.line and end.column > start.column
    return Span(start.line + 1, start.column + 1, end.column + 1 if same_line else None)


def _last_line(event: Event) -> int:
    """The last line that an event reaches to; a block text ends where the next line begins."""
    end: StringMark = event.end_mark
    is_block = end.column == 0 and end.line > event.start_mark.line
    return int(end.line) if is_block else int(end.line) + 1
