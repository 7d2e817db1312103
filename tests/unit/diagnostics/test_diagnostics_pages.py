"""Every code that the sources can give has a page, and every page belongs to a code that they can give."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from octoform.contracts.checking import RULES
from octoform.diagnostics.explain import codes, explain

SOURCES = Path(__file__).parents[3] / "octoform"
CODE = re.compile(r"[A-Z][A-Z0-9]*(?:-[A-Z][A-Z0-9]*)+")
MAKERS = {"error", "warning", "Rule", "Diagnostic"}


def _trees() -> Iterator[ast.Module]:
    for path in sorted(SOURCES.rglob("*.py")):
        # The embedded agent and the runtime give no diagnostics; shipped prose is no source.
        if path.relative_to(SOURCES).parts[0] not in ("builtin", "runtime"):
            yield ast.parse(path.read_text("utf-8"))


def _made(tree: ast.Module) -> Iterator[str]:
    """Codes that are passed to a maker of diagnostics as they stand."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in MAKERS and node.args:
            given = node.args[1] if node.func.id == "Diagnostic" and len(node.args) > 1 else node.args[0]
            if isinstance(given, ast.Constant) and isinstance(given.value, str):
                yield given.value


def _spelt(tree: ast.Module) -> Iterator[str]:
    """Every string that has the form of a code."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and CODE.fullmatch(node.value):
            yield node.value


def _patterns(tree: ast.Module) -> Iterator[re.Pattern[str]]:
    """Codes that are put together: constant parts in capitals around a value."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.JoinedStr):
            continue
        parts = [item.value if isinstance(item, ast.Constant) else None for item in node.values]
        fixed = "".join(str(part) for part in parts if part is not None)
        if None in parts and re.fullmatch(r"[A-Z0-9-]*[A-Z]{3}[A-Z0-9-]*", fixed) and "-" in fixed:
            yield re.compile("".join("[A-Z0-9-]+" if part is None else re.escape(str(part)) for part in parts))


TREES = list(_trees())
MADE = {code for tree in TREES for code in _made(tree)}
FAMILIES = {code.partition("-")[0] for code in MADE | set(codes())}
SPELT = {code for tree in TREES for code in _spelt(tree) if code.partition("-")[0] in FAMILIES}
PATTERNS = [pattern for tree in TREES for pattern in _patterns(tree)]


def test_every_code_has_the_form_of_one() -> None:
    assert [code for code in sorted(MADE) if not CODE.fullmatch(code)] == []


def test_every_code_has_a_page() -> None:
    ruled = {rule.code for rules in RULES.values() for rule in rules}
    shapes = {f"{stage.upper()}-SCHEMA" for stage in RULES if stage != "serve"}
    assert sorted((MADE | SPELT | ruled | shapes) - set(codes())) == []


def test_every_page_has_a_code() -> None:
    given = MADE | SPELT
    idle = [code for code in codes() if code not in given and not any(item.fullmatch(code) for item in PATTERNS)]
    assert idle == []


@pytest.mark.parametrize("code", codes())
def test_a_page_begins_with_its_code_and_says_what_to_do(code: str) -> None:
    page = explain(code)
    assert page is not None
    first, _, rest = page.partition("\n")
    title = re.fullmatch(rf"# {code}: (\S.*)", first)
    assert title is not None and not title[1].endswith(".")
    assert len(rest.split()) >= 20
    assert page.endswith("\n") and max(map(len, page.splitlines())) <= 140
    assert page.count("```") % 2 == 0


def test_explain_knows_a_code_however_it_is_typed() -> None:
    assert explain(" probe-duplicate-id ") == explain("PROBE-DUPLICATE-ID")
    for strange in ("", "NO-SUCH-CODE", "../model", "PROBE-DUPLICATE-ID.md", "PROBE", "É-X"):
        assert explain(strange) is None
