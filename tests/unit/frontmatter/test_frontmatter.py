"""Front matter: plain values with their places, and nothing else."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform import frontmatter
from octoform.diagnostics import Span, error

PATH = Path("spec.md")


def test_values_body_and_places() -> None:
    text = "---\nname: x\nlist: [a, 1, 1.5, true, null]\nnested:\n  - {low: -2, high: 0x10}\n---\n\n# Body\n---\nmore\n"
    document, found = frontmatter.parse(PATH, text, "CODE")
    assert found == []
    assert document is not None
    assert document.fields == {
        "name": "x",
        "list": ["a", 1, 1.5, True, None],
        "nested": [{"low": -2, "high": "0x10"}],
    }
    assert document.body == "# Body\n---\nmore\n"
    assert document.places[("nested", 0, "low")] == Span(5, 11, 13)
    problem = document.problem("CODE", "wrong", ("nested", 0, "low", "deeper"))
    assert (problem.span, problem.source, problem.path) == (Span(5, 11, 13), "  - {low: -2, high: 0x10}", "spec.md")


def test_fields_by_name_are_as_in_the_whole_and_in_their_places() -> None:
    lines = ["---", "# of a copy", "rig: {facts: [one]}", "'wanted':", "- a: 1", "  # said", "", "-  b: 2", "other: |"]
    text = "\n".join([*lines, "  wanted: no field", '"last" : x', "---", "Body."])
    whole, _ = frontmatter.parse(PATH, text, "CODE")
    some, found = frontmatter.parse(PATH, text, "CODE", frozenset({"wanted", "last", "missing"}))
    assert whole is not None and some is not None and found == []
    assert some.fields == {"wanted": [{"a": 1}, {"b": 2}], "last": "x"} and some.body == whole.body
    assert some.fields == {name: whole.fields[name] for name in some.fields}
    assert all(some.places[place] == whole.places[place] for place in some.places if place)


@pytest.mark.parametrize(
    ("text", "summary", "line"),
    [
        ("", "no front matter", 1),
        ("# Title\n", "no front matter", 1),
        ("---\nname: x\n", "no end", 1),
        ("---\n- a\n---\n", "no mapping", 2),
        ("---\nname: x\nname: y\n---\n", "occurs twice", 3),
        ("---\na: &x [1]\nb: *x\n---\n", "anchors", 2),
        ("---\na: !!python/object:os.system x\n---\n", "tags", 2),
        ("---\nname: [x\n---\n", "expected", 3),
        ("---\n\tname: x\n---\n", "cannot start any token", 2),
        ("---\n? [a]\n: b\n---\n", "plain text", 2),
        (f"---\na: {'[' * 800}\n---\n", "", 2),
    ],
)
def test_what_is_refused_says_where(text: str, summary: str, line: int) -> None:
    document, found = frontmatter.parse(PATH, text, "CODE")
    assert document is None
    assert summary in found[0].summary
    assert found[0].code == "CODE"
    assert found[0].span is not None and found[0].span.line == line


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    broken = tmp_path / "latin.md"
    broken.write_bytes(b"---\nname: caf\xe9\n---\n")
    document, found = frontmatter.read(broken, "CODE")
    assert document is None
    assert found[0].span == Span(2, 10)
    large = tmp_path / "large.md"
    large.write_bytes(b"---\nname: x\n---\n" + b"x" * frontmatter.MAX_BYTES)
    assert "larger than" in frontmatter.read(large, "CODE")[1][0].summary
    absent = frontmatter.read(tmp_path / "absent.md", "CODE")[1][0]
    assert "cannot be read" in absent.summary and "replace it by a text file" in str(absent.hint)


def test_byte_order_mark_and_line_ends_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "windows.md"
    path.write_bytes(b"\xef\xbb\xbf---\r\nname: x\r\n---\r\n\r\nBody\r\n")
    document, found = frontmatter.read(path, "CODE")
    assert found == []
    assert document is not None
    assert (document.fields, document.body) == ({"name": "x"}, "Body\n")


@given(st.text(max_size=300))
def test_any_text_is_a_document_or_a_diagnostic(text: str) -> None:
    for candidate in (text, f"---\n{text}\n---\nbody"):
        document, found = frontmatter.parse(PATH, candidate, "CODE")
        assert (document is None) == bool(found)


def test_the_same_text_is_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    text = "---\nname: the same\n---\nbody\n"
    document, found = frontmatter.parse(PATH, text, "CODE")
    monkeypatch.setattr(frontmatter, "YAML", None)  # it is not asked again
    assert frontmatter.parse(PATH, text, "CODE") == (document, found)
    found.append(error("CODE", "of who asked first"))
    assert frontmatter.parse(PATH, text, "CODE") == (document, [])


def test_a_nul_is_told_with_its_place_wherever_it_stands() -> None:
    for text, place in (("---\na: \0\n---\nbody\n", Span(2, 4)), ("---\na: b\n---\n\nbo\0dy\n", Span(5, 3))):
        document, found = frontmatter.parse(PATH, text, "CODE")
        assert document is None
        assert [(item.summary, item.span, item.hint) for item in found] == [
            ("the character U+0000 may not be in the file", place, "delete it")
        ]
