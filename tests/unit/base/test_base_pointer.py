"""JSON pointers: RFC 6901 and the local references of a schema."""

from octoform.base.shape import pointer, resolve


def test_a_pointer_leads_back_to_where_it_was_made() -> None:
    value = {"a/b": [{"~": 1}], "": {"x": None}, "~1": 2}
    for parts in (("a/b", 0, "~"), ("a/b", 0), ("", "x"), ("~1",), ()):
        expected: object = value
        for part in parts:
            expected = expected[part]  # type: ignore[index]
        assert resolve(value, pointer(*parts)) == expected == resolve(value, f"#{pointer(*parts)}")
    assert pointer("a/b", 0, "~") == "/a~1b/0/~0"


def test_what_is_not_there_is_none() -> None:
    value = {"a": [1], "b": "text"}
    assert [resolve(value, place) for place in ("/a/1", "/a/-1", "/a/x", "/b/0", "/c/d", "/a/0/0")] == [None] * 6
