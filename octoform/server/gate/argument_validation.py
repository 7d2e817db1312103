"""Whether arguments fit a tool before anything is counted or asked, and whether a result fits before it leaves.

Arguments go through the same validation that FastMCP will put them through, against a function that does nothing: the
limits see the values that the tool will see, with coercions and defaults. A result that breaks its tool's output schema
crashes many a client, so it is compared here; the comparison is built once for each tool, because a general validator
costs as much as the whole call.
"""

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, cast, get_type_hints

from fastmcp.server.dependencies import without_injected_parameters
from pydantic import TypeAdapter

from octoform.base.shape import resolve

Check = Callable[[Any], str | None]
"""The problem of a value, as words that follow its place; None when it fits."""


class Effective(NamedTuple):
    """Arguments as a tool receives them: ``shown`` by the names of its schema, then the call of its function."""

    shown: Mapping[str, Any]
    args: tuple[Any, ...] = ()
    kwargs: Mapping[str, Any] = {}


NOTHING = Effective({})
Coerce = Callable[[Mapping[str, Any]], Effective]

_KINDS: dict[str, Callable[[Any], bool]] = {
    "object": lambda value: isinstance(value, dict),
    "array": lambda value: isinstance(value, list),
    "string": lambda value: isinstance(value, str),
    "boolean": lambda value: isinstance(value, bool),
    "null": lambda value: value is None,
    "number": lambda value: isinstance(value, int | float) and not isinstance(value, bool),
    "integer": lambda value: (
        not isinstance(value, bool) and (isinstance(value, int) or (isinstance(value, float) and value.is_integer()))
    ),
}


def coercion(function: Callable[..., Any], strict: bool) -> Coerce:
    """Returns the arguments as ``function`` will receive them, with defaults; raises pydantic's ValidationError.

    A parameter may bear another name in the schema than in the code (an alias). Anyone who calls, limits and approves
    knows the schema alone, so that name is the one that counts.
    """
    bare = without_injected_parameters(function, run_in_thread=False)
    signature = inspect.signature(bare)

    names = tuple(signature.parameters)

    def collect(*args: Any, **kwargs: Any) -> Effective:
        whole = {**dict(zip(names, args, strict=False)), **kwargs} if args else kwargs
        # The validation filled in the defaults.
        return Effective({name: whole[own] for own, name in schema_names if own in whole}, args, kwargs)

    try:
        hints = get_type_hints(bare, include_extras=True)
    except (NameError, TypeError):
        hints = dict(getattr(bare, "__annotations__", {}))
    collect.__signature__ = signature  # type: ignore[attr-defined]
    collect.__annotations__ = {
        name: hints.get(name, each.annotation)
        for name, each in signature.parameters.items()
        if name in hints or each.annotation is not inspect.Parameter.empty
    }
    collect.__name__ = collect.__qualname__ = getattr(function, "__name__", "call")
    adapter = TypeAdapter(cast(Any, collect))
    schema_names = tuple(zip(names, adapter.json_schema().get("properties", {}), strict=True))
    validator = adapter.validator
    if strict:
        return lambda arguments: cast(Effective, validator.validate_json(_json(arguments), strict=True))
    return cast(Coerce, validator.validate_python)


def _json(arguments: Mapping[str, Any]) -> bytes:
    from pydantic_core import to_json

    return to_json(arguments)


def check(schema: Mapping[str, Any]) -> Check:
    """The comparison with a JSON Schema; keywords that no tool's result needs are not looked at."""
    return _Builder(schema).build(schema)


class _Builder:
    """Builds the comparisons of one document, whose ``$ref`` stay within it."""

    def __init__(self, document: Mapping[str, Any]) -> None:
        self._document = document
        self._built: dict[str, Check] = {}

    def build(self, schema: Any) -> Check:
        if schema is False:
            return lambda _: " is not allowed"
        if not isinstance(schema, Mapping):
            return lambda _: None
        checks = [
            found
            for found in (
                self._reference(schema),
                _type(schema),
                _fixed(schema),
                _bounds(schema),
                _text(schema),
                self._properties(schema),
                self._items(schema),
                *self._choices(schema),
            )
            if found is not None
        ]
        return _all(checks)

    def _reference(self, schema: Mapping[str, Any]) -> Check | None:
        place = schema.get("$ref")
        if not isinstance(place, str) or not place.startswith("#"):
            return None
        if place not in self._built:
            target = resolve(self._document, place)
            self._built[place] = lambda value: self._built[place](value)  # a schema may contain itself
            self._built[place] = self.build(target)
        return lambda value: self._built[place](value)

    def _properties(self, schema: Mapping[str, Any]) -> Check | None:
        known = {name: self.build(part) for name, part in dict(schema.get("properties") or {}).items()}
        required = tuple(schema.get("required") or ())
        others = self.build(schema.get("additionalProperties", True))
        if not known and not required and "additionalProperties" not in schema:
            return None

        def compare(value: Any) -> str | None:
            if not isinstance(value, dict):
                return None
            for name in required:
                if name not in value:
                    return f" has no {name!r}"
            for name, item in value.items():
                if problem := known.get(name, others)(item):
                    return f".{name}{problem}"
            return None

        return compare

    def _items(self, schema: Mapping[str, Any]) -> Check | None:
        first = [self.build(part) for part in schema.get("prefixItems") or ()]
        least, most = schema.get("minItems", 0), schema.get("maxItems", math.inf)
        if "items" not in schema and not first and not least and most == math.inf:
            return None
        rest = self.build(schema.get("items", True))

        def compare(value: Any) -> str | None:
            if not isinstance(value, list):
                return None
            if not least <= len(value) <= most:
                return f" has {len(value)} items"
            for index, item in enumerate(value):
                if problem := (first[index] if index < len(first) else rest)(item):
                    return f"[{index}]{problem}"
            return None

        return compare

    def _choices(self, schema: Mapping[str, Any]) -> Sequence[Check]:
        found = [_all([self.build(part) for part in schema["allOf"]])] if "allOf" in schema else []
        for word in ("anyOf", "oneOf"):
            if word in schema:
                found.append(_any([self.build(part) for part in schema[word]]))
        return found


def _all(checks: Sequence[Check]) -> Check:
    if len(checks) == 1:
        return checks[0]

    def compare(value: Any) -> str | None:
        for each in checks:
            if problem := each(value):
                return problem
        return None

    return compare


def _any(checks: Sequence[Check]) -> Check:
    def compare(value: Any) -> str | None:
        problem = None
        for each in checks:
            if (problem := each(value)) is None:
                return None
        return problem

    return compare


def _type(schema: Mapping[str, Any]) -> Check | None:
    named = schema.get("type")
    if named is None:
        return None
    names = [named] if isinstance(named, str) else list(named)
    tests = [_KINDS[name] for name in names if name in _KINDS]
    words = f" is no {' or '.join(names)}"
    if len(tests) == 1:
        only = tests[0]
        return lambda value: None if only(value) else words
    return lambda value: None if any(test(value) for test in tests) else words


def _fixed(schema: Mapping[str, Any]) -> Check | None:
    if "const" in schema:
        allowed = [schema["const"]]
    elif "enum" in schema:
        allowed = list(schema["enum"])
    else:
        return None
    return lambda value: (
        None
        if any(value == each and type(value) is type(each) for each in allowed)
        else " is none of the allowed values"
    )


def _bounds(schema: Mapping[str, Any]) -> Check | None:
    least, most = schema.get("minimum", -math.inf), schema.get("maximum", math.inf)
    above, below = schema.get("exclusiveMinimum", -math.inf), schema.get("exclusiveMaximum", math.inf)
    if (least, most, above, below) == (-math.inf, math.inf, -math.inf, math.inf):
        return None

    def compare(value: Any) -> str | None:
        if isinstance(value, bool) or not isinstance(value, int | float):
            return None
        inside = (
            least <= value <= most and (value > above or above == -math.inf) and (value < below or below == math.inf)
        )
        return None if inside else f" is {value!r}, outside of its bounds"

    return compare


def _text(schema: Mapping[str, Any]) -> Check | None:
    least, most = schema.get("minLength", 0), schema.get("maxLength", math.inf)
    pattern = schema.get("pattern")
    if not least and most == math.inf and pattern is None:
        return None
    try:
        matches = re.compile(pattern).search if pattern is not None else None
    except re.error:  # an expression of another dialect
        matches = None

    def compare(value: Any) -> str | None:
        if not isinstance(value, str):
            return None
        if not least <= len(value) <= most:
            return f" has {len(value)} characters"
        return None if matches is None or matches(value) else " does not match its pattern"

    return compare
