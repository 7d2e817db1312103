"""Whatever stands in the file: an answer comes, with places inside the file, and no secret in it."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from manifest_cases import render_all
from ruamel.yaml import YAML

from octoform.diagnostics import Diagnostic, has_errors, to_json
from octoform.manifest.loader import parse
from octoform.manifest.schema.document import json_schema


def _words() -> st.SearchStrategy[str]:
    """Made for the first example: the schema takes a third of a second, which each worker's collection would spend."""
    tables = [json_schema(), *json_schema()["$defs"].values()]
    more = {"builtin", "command", "opencode", "local", "internet", "usd", "answers", "arm", "stdin", "200s", "5", "yes"}
    return st.sampled_from(sorted({key for table in tables for key in table.get("properties", {})} | more))


WORDS = st.deferred(_words)
SIGNS = [
    ": ",
    "\n",
    "\n  ",
    "\n- ",
    "{",
    "}",
    "[",
    "]",
    ", ",
    "#",
    "&a ",
    "*a",
    "!!str ",
    "<<: ",
    '"',
    "'",
    "|\n",
    "\t",
]
SIGNS += [
    "---\n",
    "%YAML 1.2\n",
    "${X}",
    "${",
    "\\u",
    "? ",
    "~",
    "null",
    "true",
    "1e3",
    "0x1f",
    "é",
    "相",
    "\r\n",
    "\x85",
]
SIGN = st.sampled_from(SIGNS)
values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | WORDS | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(WORDS | st.text(), inner, max_size=5),
    max_leaves=25,
)


def check(content: bytes) -> list[Diagnostic]:
    """Parse, and hold what must hold for any input."""
    manifest, found = parse(content, Path("octopus.yaml"), {"X": "x"})
    assert has_errors(found) == (manifest is None)
    lines = content.decode("utf-8", "replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")
    for item in found:
        assert item.code.startswith("MANIFEST-")
        assert len(item.summary) < 400
        assert item.summary.isprintable() or "\ufffd" in item.summary or not item.summary.isascii()
        if item.span is not None:
            assert 1 <= item.span.line <= len(lines) + 1
            assert item.span.column >= 1
    assert render_all(found, colour=True) or not found
    json.dumps([to_json(item) for item in found]).encode()
    return found


@given(st.binary(max_size=300))
def test_any_bytes(content: bytes) -> None:
    check(content)


@given(st.lists((WORDS | SIGN) | st.text(max_size=5), max_size=40).map("".join))
def test_any_text_that_looks_like_yaml(text: str) -> None:
    check(text.encode("utf-8", "surrogatepass"))


@given(st.dictionaries(WORDS, values, max_size=8))
def test_any_data(data: dict[str, Any]) -> None:
    check(("version: 1\nx: " + json.dumps(data)).encode())
    check(json.dumps({"version": 1, **data}).encode())


@given(
    st.sampled_from(["sk-", "ghp_", "AKIA", "Bearer "]),
    st.text(alphabet="ABCDEFGHIJKLMNOPQRSTUVWXYZ234567", min_size=16, max_size=16),
    st.lists(WORDS | SIGN, max_size=12).map("".join),
    st.lists(WORDS | SIGN, max_size=12).map("".join),
)
def test_a_secret_is_never_shown(prefix: str, body: str, before: str, after: str) -> None:
    found = check(f"version: 1\n{before} {prefix}{body} {after}\n".encode())
    assert body not in render_all(found, colour=False)
    assert body not in json.dumps([to_json(item) for item in found])
    assert has_errors(found)


@pytest.mark.parametrize("key", ["password", "api_key", "OPENAI_API_KEY", "auth-token", "secret", "credentials"])
@pytest.mark.parametrize(
    "form", ["{key}: {value}", "{key}: '{value}'", "{{{key}: {value}}}", "{key}: {value}: x", "\t{key}: {value}"]
)
def test_the_value_of_a_secret_name_is_never_shown(key: str, form: str) -> None:
    text = "version: 1\n" + form.format(key=key, value="correcthorse") + "\n"
    _, found = parse(text.encode(), Path("octopus.yaml"), {})
    assert "correcthorse" not in render_all(found, colour=False)


@given(st.dictionaries(WORDS, values, max_size=6))
def test_the_yaml_reader_and_ours_agree(data: dict[str, Any]) -> None:
    """The tree is built of events; its data are those that the reader itself would make of JSON."""
    from octoform.manifest import yaml_tree
    from octoform.manifest.problem_list import ProblemList
    from octoform.manifest.yaml_parser import read_tree

    text = json.dumps({"version": 1, **data}, allow_nan=False) if _is_finite(data) else "{a: 1}"
    report = ProblemList("x")
    report.read(text)
    root = read_tree(text, report)
    if root is not None and not report.failed:
        assert yaml_tree.data(root) == YAML(typ="safe", pure=True).load(text)


def _is_finite(value: object) -> bool:
    try:
        json.dumps(value, allow_nan=False)
    except ValueError:
        return False
    return True
