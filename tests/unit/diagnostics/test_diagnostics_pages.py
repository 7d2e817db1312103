"""Every code that the sources can give has a page, and every page belongs to a code that they can give."""

import ast
import re
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from cases import for_each

from octoform.contracts.contract_check import RULES
from octoform.diagnostics import codes, page_of

SOURCES = Path(__file__).parents[3] / "octoform"
CODE = re.compile(r"[A-Z][A-Z0-9]*(?:-[A-Z][A-Z0-9]*)+")
MAKERS = {"error", "warning", "Rule", "Diagnostic"}


@dataclass
class Found:
    """What all sources say: codes passed to a maker, every text in the form of a code, and codes put together."""

    made: set[str] = field(default_factory=set)
    spelt: set[str] = field(default_factory=set)
    patterns: list[re.Pattern[str]] = field(default_factory=list)

    def look_at(self, node: ast.AST) -> None:
        """Take the text of one node of a source."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS and node.args:
            # Codes that are passed to a maker of diagnostics as they stand.
            given = node.args[1] if node.func.id == "Diagnostic" and len(node.args) > 1 else node.args[0]
            if isinstance(given, ast.Constant) and isinstance(given.value, str):
                self.made.add(given.value)
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, str) and CODE.fullmatch(node.value):
                self.spelt.add(node.value)
        elif isinstance(node, ast.JoinedStr):
            # Codes that are put together: constant parts in capitals around a value.
            parts = [item.value if isinstance(item, ast.Constant) else None for item in node.values]
            fixed = "".join(str(part) for part in parts if part is not None)
            if None in parts and re.fullmatch(r"[A-Z0-9-]*[A-Z]{3}[A-Z0-9-]*", fixed) and "-" in fixed:
                text = "".join("[A-Z0-9-]+" if part is None else re.escape(str(part)) for part in parts)
                self.patterns.append(re.compile(text))


@pytest.fixture(scope="module")
def found() -> Found:
    """Read once, and by the worker alone that passes these tests."""
    whole = Found()
    for path in sorted(SOURCES.rglob("*.py")):
        # The embedded agent and the runtime give no diagnostics; shipped prose is no source.
        if path.relative_to(SOURCES).parts[0] not in ("builtin", "runtime"):
            for node in ast.walk(ast.parse(path.read_text("utf-8"))):
                whole.look_at(node)
    families = {code.partition("-")[0] for code in whole.made | set(codes())}
    whole.spelt = {code for code in whole.spelt if code.partition("-")[0] in families}
    return whole


def test_every_code_has_the_form_of_one(found: Found) -> None:
    assert [code for code in sorted(found.made) if not CODE.fullmatch(code)] == []


def test_every_code_has_a_page(found: Found) -> None:
    ruled = {rule.code for rules in RULES.values() for rule in rules}
    shapes = {f"{stage.upper()}-SCHEMA" for stage in RULES if stage != "serve"}
    assert sorted((found.made | found.spelt | ruled | shapes) - set(codes())) == []


def test_every_page_has_a_code(found: Found) -> None:
    given = found.made | found.spelt
    idle = [code for code in codes() if code not in given and not any(item.fullmatch(code) for item in found.patterns)]
    assert idle == []


@for_each("code", codes())
def test_a_page_begins_with_its_code_and_says_what_to_do(code: str) -> None:
    page = page_of(code)
    assert page is not None
    first, _, rest = page.partition("\n")
    title = re.fullmatch(rf"# {code}: (\S.*)", first)
    assert title is not None and not title[1].endswith(".")
    assert len(rest.split()) >= 20
    assert page.endswith("\n") and max(map(len, page.splitlines())) <= 140
    assert page.count("```") % 2 == 0


def test_explain_knows_a_code_however_it_is_typed() -> None:
    assert page_of(" probe-duplicate-id ") == page_of("PROBE-DUPLICATE-ID")
    for strange in ("", "NO-SUCH-CODE", "../model", "PROBE-DUPLICATE-ID.md", "PROBE", "É-X"):
        assert page_of(strange) is None
