"""Strict reading: what ordinary JSON readers let pass is refused, with its place; nothing ever raises."""

import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.contracts import parse
from octoform.contracts.artifact_parser import MAX_DEPTH, MAX_JSON_BYTES, MAX_SOURCE_BYTES

REFUSED = [
    (b"", "ARTIFACT-EMPTY", None),
    (b" \r\n\t ", "ARTIFACT-EMPTY", None),
    (b"{" + b" " * MAX_JSON_BYTES, "ARTIFACT-TOO-LARGE", None),
    (b'{"a": "\xff"}', "ARTIFACT-NOT-UTF8", (1, 8)),
    (b"\xef\xbb\xbf{}", "ARTIFACT-NOT-UTF8", (1, 1)),
    (b'{"a": 1,\n "b": }', "ARTIFACT-NOT-JSON", (2, 7)),
    (b'{"a": [1, 2', "ARTIFACT-NOT-JSON", (1, 12)),
    (b"{} {}", "ARTIFACT-NOT-JSON", (1, 4)),
    (b"```json\n{}\n```", "ARTIFACT-NOT-JSON", (1, 1)),
    (b'{"a": {"b": 1},\n "a": 2}', "ARTIFACT-DUPLICATE-KEY", (2, 2)),
    (b'{"a": [{"x": 1, "\\u0078": 2}]}', "ARTIFACT-DUPLICATE-KEY", (1, 17)),
    (b'{"a": NaN}', "ARTIFACT-BAD-NUMBER", (1, 7)),
    (b"[1, -Infinity]", "ARTIFACT-BAD-NUMBER", (1, 5)),
    (b"[1e999]", "ARTIFACT-BAD-NUMBER", (1, 2)),
    (b"[" + b"9" * 5000 + b"]", "ARTIFACT-BAD-NUMBER", (1, 2)),
    (b"[" * (MAX_DEPTH + 1) + b"]" * (MAX_DEPTH + 1), "ARTIFACT-TOO-DEEP", (1, MAX_DEPTH + 1)),
    (b"[" * 200_000, "ARTIFACT-TOO-DEEP", (1, MAX_DEPTH + 1)),
    (b'["\\ud83d\\ude00", "\\ud800"]', "ARTIFACT-LONE-SURROGATE", (1, 18)),
    (b'{"\\udfff": 1}', "ARTIFACT-LONE-SURROGATE", (1, 2)),
]


@pytest.mark.parametrize(("data", "code", "place"), REFUSED, ids=range(len(REFUSED)))
def test_what_is_not_strict_json_is_refused_with_its_place(
    data: bytes, code: str, place: tuple[int, int] | None
) -> None:
    value, found = parse("probe", data, "out.json")
    assert value is None
    [problem] = found
    assert (problem.code, problem.path) == (code, "out.json")
    assert problem.hint or code == "ARTIFACT-NOT-JSON"
    assert (None if problem.span is None else (problem.span.line, problem.span.column)) == place


def test_the_source_line_is_shown_with_true_columns() -> None:
    _, [problem] = parse("probe", b'{\n\t"caf\xc3\xa9": 1, "caf\xc3\xa9": 2}', "out.json")
    assert problem.span is not None and problem.source is not None
    assert problem.source[problem.span.column - 1 :].startswith('"café": 2')


def test_a_place_beyond_the_shown_part_of_a_line_has_no_source() -> None:
    _, [problem] = parse("probe", b'{"a": "' + b"x" * 5000 + b'", "b": nope}', "out.json")
    assert problem.span is not None and problem.span.column > 5000
    assert problem.source is None


def test_depth_up_to_the_limit_is_read() -> None:
    value, found = parse("probe", b"[" * MAX_DEPTH + b"]" * MAX_DEPTH, "out.json")
    assert found == [] and isinstance(value, list)


def test_serve_is_text() -> None:
    assert parse("serve", b"x = 1\n", "server.py") == ("x = 1\n", [])
    assert parse("serve", b" \n", "server.py")[1][0].code == "ARTIFACT-EMPTY"
    assert parse("serve", b"#" * (MAX_SOURCE_BYTES + 1), "server.py")[1][0].code == "ARTIFACT-TOO-LARGE"


@given(st.binary(max_size=400))
def test_no_bytes_make_it_raise(data: bytes) -> None:
    for stage in ("probe", "serve"):
        value, found = parse(stage, data, "x")
        assert (value is None) or not found


@given(st.text(alphabet='{}[]",:\\u d8N0aIe9-+.\n', max_size=60))
def test_no_text_that_looks_like_json_makes_it_raise(text: str) -> None:
    value, found = parse("probe", text.encode(), "x")
    if not found:
        assert json.loads(text) == value


_JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(10**30), 10**30)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(_JSON, st.booleans())
def test_good_json_is_read_as_it_is(value: object, ascii_only: bool) -> None:
    assert parse("probe", json.dumps(value, ensure_ascii=ascii_only).encode(), "x") == (value, [])
