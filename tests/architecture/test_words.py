"""Words of a private language are gone from what a person reads: README, docs, diagnostic pages, messages and help.

Names in backticks and JSON keys in quotes are those of formats, and stay. Decisions quote what was decided.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "octoform"
RETIRED = re.compile(
    r"\b(?:anew|nobody|whoever|for ever|latched|corroborated|onboardable|specimens?|taken over"
    r"|left out|left aside|set aside|mend(?:s|ed|ing)?|purses?|veils?|beheld|sightings?)\b(?!_)",
    re.IGNORECASE,
)
# What messages of the contracts still say, and no page does.
IN_PAGES = re.compile(
    r"\b(?:told|troubles?|evidence rules?|nothing said|whole numbers?|stands twice|meaning is missing|for trial"
    r"|would then hold|aside|command grammars?)\b(?!_)",
    re.IGNORECASE,
)
CODE = re.compile(r"```.*?```|`[^`\n]*`|\"\w+\"(?=:)|\b[A-Z]+(?:-[A-Z]+)+\b", re.DOTALL)
QUOTING = ("docs/decisions/", "docs/paper.md")
# The embedded agent's texts are held by its recordings, and the island of the server is read by endpoints in service.
OTHERS = {"builtin", "protocol", "runtime", "server", "simulation"}


def pages() -> Iterator[Path]:
    """The README, the docs and the pages of the diagnostic codes."""
    yield ROOT / "README.md"
    found = [*sorted((ROOT / "docs").rglob("*.md")), *sorted((PACKAGE / "diagnostics/pages").glob("*.md"))]
    yield from (path for path in found if not path.relative_to(ROOT).as_posix().startswith(QUOTING))


def prose(text: str) -> str:
    """A page without what is code in it."""
    return CODE.sub("", text)


def sentences(source: str) -> Iterator[str]:
    """The strings of a module that are sentences: those with a blank that are no docstring."""
    tree = ast.parse(source)
    plain = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Constant)
            and isinstance(node.value, str)
            and id(node) not in plain
            and " " in node.value
        ):
            yield node.value


def test_no_page_says_a_word_that_is_gone() -> None:
    read = {path.relative_to(ROOT).as_posix(): prose(path.read_text()) for path in pages()}
    found = {name: RETIRED.findall(text) + IN_PAGES.findall(text) for name, text in read.items()}
    assert {name: words for name, words in found.items() if words} == {}


def test_no_message_says_a_word_that_is_gone() -> None:
    found = {
        path.relative_to(PACKAGE).as_posix(): [line for line in sentences(path.read_text()) if RETIRED.search(line)]
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).parts[0] not in OTHERS
    }
    assert {name: lines for name, lines in found.items() if lines} == {}


@pytest.mark.parametrize("text", ["made anew", "Nobody answers", "it was left out", "mended by hand"])
def test_the_rule_sees_what_it_forbids(text: str) -> None:
    assert RETIRED.search(prose(text))
    assert any(RETIRED.search(line) for line in sentences(f"def f():\n    '''doc'''\n    return f'{{x}} {text}'"))


@pytest.mark.parametrize("text", ["the key `left_out`", '{"latched": true}', "left_out", "recommended", "specimen_id"])
def test_the_rule_lets_names_of_formats_pass(text: str) -> None:
    assert not RETIRED.search(prose(text))
