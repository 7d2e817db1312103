"""Harmless arguments from a schema."""

from typing import Any

import pytest

from octoform.endpoint.client.check import sample_arguments


def needing(**schema: Any) -> dict[str, Any]:
    return {"input_schema": {"type": "object", "properties": {"x": schema}, "required": ["x"]}}


@pytest.mark.parametrize(
    ("schema", "value"),
    [
        ({"type": "integer", "default": 5, "minimum": 1}, 5),
        ({"const": "on"}, "on"),
        ({"type": "string", "enum": ["a", "b"]}, "a"),
        ({"type": "string", "examples": ["GPIO1"]}, "GPIO1"),
        ({"type": "integer", "minimum": 3}, 3),
        ({"type": "integer", "exclusiveMinimum": 3}, 4),
        ({"type": "number", "maximum": -1.5}, -1.5),
        ({"type": "boolean"}, False),
        ({"type": "array"}, []),
        ({"type": "array", "minItems": 2, "items": {"enum": [1]}}, [1, 1]),
    ],
)
def test_a_required_parameter_gets_a_value_that_its_schema_names(schema: dict[str, Any], value: Any) -> None:
    assert sample_arguments(needing(**schema)) == {"x": value}


@pytest.mark.parametrize(
    "schema",
    [
        {"type": "string"},
        {"type": "number"},
        {"type": "object", "required": ["y"]},
        {},
        {"type": "array", "minItems": 1},
    ],
)
def test_no_value_is_invented(schema: dict[str, Any]) -> None:
    assert sample_arguments(needing(**schema)) is None


def test_the_authors_arguments_come_first_and_optional_ones_stay_away() -> None:
    item = needing(type="string")
    item["smoke"] = {"arguments": {"x": "front"}}
    assert sample_arguments(item) == {"x": "front"}
    assert sample_arguments({"input_schema": {"type": "object", "properties": {"x": {"default": 1}}}}) == {}
