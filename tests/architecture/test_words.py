"""Words of a private language are gone from what a person or an agent reads: pages, specs, prompts, messages and help.

They are gone from docstrings and comments too. Names in backticks and JSON keys in quotes are those of formats, and
stay. Decisions quote what was decided, and the page about the paper speaks of its tiers.
"""

import ast
import io
import json
import re
import tokenize
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from architecture.parsed import nodes

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "octoform"
PROTOCOL = ROOT / "protocol"
RETIRED = re.compile(
    r"\b(?:anew|nobody|whoever|for ever|latched|corroborat(?:ed|es|ing)|onboardable|specimens?|taken over|lent|donors?"
    r"|left out|left aside|set aside|aside|mend(?:s|ed|ing)?|purses?|veils?|beheld|sightings?|anonymity"
    r"|told|tells|untold|said|says|troubles?|nothing said|evidence rules?|would then hold|meaning is missing"
    r"|whole numbers?|a text(?! file)|folder links?|stands? (?:in|twice|nowhere|here|there|beside)|stood"
    r"|trials?|grammars?(?!:)|annotated(?!\[)|enumerated|surfaced|over by itself|of the machine's own"
    r"|rooms?'s? fault|(?<!paper's )tiers? [123])\b(?![_'])(?!\})",
    re.IGNORECASE,
)
COMMENTED = re.compile(rf"#.*{RETIRED.pattern}", re.IGNORECASE)
CODE = re.compile(r"```.*?```|``[^`\n]+``|`[^`\n]*`|\"\w+\"(?=:)|\b[A-Z]+(?:-[A-Z]+)+\b", re.DOTALL)
QUOTING = ("docs/decisions/", "docs/paper.md")
# Strings that are no sentences to a person: stored as they are in a file of the daemon's.
STORED = {"whatever it says"}
# Patterns that find orders or words in foreign text have the foreign words.
PATTERN = re.compile(r"\\[bsw]|\(\?:")


def pages() -> Iterator[Path]:
    """README, docs, the pages of the diagnostic codes, the specs of the stages and the templates of prompts."""
    yield ROOT / "README.md"
    found = [*sorted((ROOT / "docs").rglob("*.md")), *sorted((PACKAGE / "diagnostics/pages").glob("*.md"))]
    found += [*sorted(PROTOCOL.rglob("*.md")), *sorted((PACKAGE / "protocol/templates").glob("*.j2"))]
    found += sorted((PACKAGE / "harness").rglob("*.md"))
    yield from (path for path in found if not path.relative_to(ROOT).as_posix().startswith(QUOTING))


def prose(text: str) -> str:
    """A page without what is code in it."""
    return CODE.sub("", text)


def described(value: Any) -> Iterator[str]:
    """The descriptions and titles of a JSON Schema."""
    if isinstance(value, dict):
        for key, member in value.items():
            if key in ("description", "title") and isinstance(member, str):
                yield member
            yield from described(member)
    elif isinstance(value, list):
        for member in value:
            yield from described(member)


def sentences(source: str) -> Iterator[str]:
    """The strings of a module that are sentences: those with a blank that are neither docstring nor pattern."""
    plain = {id(node.value) for node in nodes(source) if isinstance(node, ast.Expr)}
    for node in nodes(source):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in plain
            and " " in node.value
            and not PATTERN.search(node.value)
            and node.value not in STORED
        ):
            yield node.value


def remarks(source: str) -> Iterator[str]:
    """The docstrings of a module, those below an assignment included, and its comments if a line may have a bad one."""
    for node in nodes(source):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield node.value.value
    if not COMMENTED.search(source):  # to tell comments from strings takes longer than all else
        return
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string


def test_no_page_says_a_word_that_is_gone() -> None:
    read = {path.relative_to(ROOT).as_posix(): prose(path.read_text()) for path in pages()}
    assert len(read) > 300
    found = {name: RETIRED.findall(text) for name, text in read.items()}
    assert {name: words for name, words in found.items() if words} == {}


def test_no_schema_says_a_word_that_is_gone() -> None:
    schemas = sorted((PROTOCOL / "schemas").glob("*.json"))
    assert len(schemas) > 5
    found = {
        path.name: [line for line in described(json.loads(path.read_text())) if RETIRED.search(prose(line))]
        for path in schemas
    }
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize("read", [sentences, remarks], ids=["messages", "docstrings and comments"])
def test_no_text_of_the_package_has_a_word_that_is_gone(read: Callable[[str], Iterator[str]]) -> None:
    found = {
        path.relative_to(PACKAGE).as_posix(): [line for line in read(path.read_text()) if RETIRED.search(prose(line))]
        for path in sorted(PACKAGE.rglob("*.py"))
    }
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize(
    "text",
    [
        *(
            "made anew",
            "Nobody answers",
            "it was left out",
            "mended by hand",
            "the profile says so",
            "it stands in a list",
        ),
        *(
            "must be a text",
            "must be a whole number",
            "a trial call",
            "the command grammar",
            "it was annotated",
            "tier 2",
        ),
    ],
)
def test_the_rule_sees_what_it_forbids(text: str) -> None:
    assert RETIRED.search(prose(text))
    assert any(RETIRED.search(line) for line in sentences(f"def f():\n    '''doc'''\n    return f'{{x}} {text}'"))
    assert any(RETIRED.search(line) for line in described({"items": [{"description": text}]}))
    for source in (f"def f():\n    '''{text}'''", f"LIMIT = 3\n'''{text}'''", f"x = 1  # {text}"):
        assert any(RETIRED.search(line) for line in remarks(source))


@pytest.mark.parametrize(
    "text",
    [
        *("the key `left_out`", '{"latched": true}', "left_out", "recommended", "specimen_id", "write grammar: {}"),
        *("a text file", "the paper's tier 1", "`says` has the source"),
    ],
)
def test_the_rule_lets_names_of_formats_pass(text: str) -> None:
    assert not RETIRED.search(prose(text))
