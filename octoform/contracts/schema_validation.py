"""The schema half of a contract: what is wrong with an artifact's shape, in words that name the field.

Heavy: imports jsonschema. The library's own messages repeat the instance, which may be large and is foreign text,
so the words here are our own, bounded and escaped.
"""

from collections.abc import Callable, Iterator
from itertools import islice
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match
from referencing import Registry

from octoform.base.escaping import display
from octoform.base.shape import pointer
from octoform.diagnostics import Diagnostic, did_you_mean, error

MAX_DIAGNOSTICS = 20

# A ValidationError; the library types each of its fields as possibly unset, which a raised one never is.
Problem = Any


def validator(schema: Any) -> Draft202012Validator:
    """A 2020-12 validator that never fetches a remote reference."""
    return Draft202012Validator(schema, registry=Registry())


def shape_diagnostics(stage: str, value: object, schema: dict[str, Any]) -> list[Diagnostic]:
    """At most `MAX_DIAGNOSTICS` breaches of the schema, each with the pointer of its field."""
    code = f"{stage.upper()}-SCHEMA"
    found: dict[tuple[str, str], Diagnostic] = {}
    for problem in islice(validator(schema).iter_errors(value), MAX_DIAGNOSTICS * 5):
        for item in _diagnostics_of(problem, code):
            found.setdefault((item.pointer or "", item.summary), item)
        if len(found) >= MAX_DIAGNOSTICS:
            break
    return list(found.values())[:MAX_DIAGNOSTICS]


def _diagnostics_of(problem: Problem, code: str) -> Iterator[Diagnostic]:
    if problem.context:
        problem = best_match(problem.context) or problem
    where = list(problem.absolute_path)
    if problem.validator == "required":
        yield from _missing(problem, code, where)
    elif problem.validator == "additionalProperties" and isinstance(problem.instance, dict):
        yield from _unknown(problem, code, where)
    else:
        words = _WORDS.get(str(problem.validator), _any_other)
        summary, hint = words(problem)
        yield error(code, f"{_field(where)} {summary}", pointer=pointer(*where), hint=hint)


def _missing(problem: Problem, code: str, where: list[str | int]) -> Iterator[Diagnostic]:
    present = problem.instance if isinstance(problem.instance, dict) else {}
    for name in problem.validator_value:
        if name not in present:
            hint = _about(problem.schema, name) or f"add {name}"
            yield error(code, f"{_field(where)} lacks the member {display(name)}", pointer=pointer(*where), hint=hint)


def _unknown(problem: Problem, code: str, where: list[str | int]) -> Iterator[Diagnostic]:
    known = list(problem.schema.get("properties", {}))
    for name in problem.instance:
        if name not in known:
            guess = did_you_mean(name, known)
            hint = f"did you mean {guess}?" if guess else f"known members: {', '.join(known)}"
            summary = f"{_field(where)} has the unknown member {display(name)}"
            yield error(code, summary, pointer=pointer(*where, name), hint=hint)


def _about(schema: Any, name: str) -> str | None:
    member = schema.get("properties", {}).get(name) if isinstance(schema, dict) else None
    description = member.get("description") if isinstance(member, dict) else None
    return f"{name}: {description}" if description else None


def _field(where: list[str | int]) -> str:
    """``devices[3].name`` as a person reads it."""
    if not where:
        return "the artifact"
    out = ""
    for part in where:
        out += f"[{part}]" if isinstance(part, int) else f".{part}"
    return display(out.lstrip("."), 120)[1:-1]


_Words = tuple[str, str | None]


def _wrong_type(problem: Problem) -> _Words:
    wanted = problem.validator_value
    names = " or ".join(wanted) if isinstance(wanted, list) else str(wanted)
    return f"must be {names}, not {_kind(problem.instance)}", None


def _not_listed(problem: Problem) -> _Words:
    allowed = [str(item) for item in problem.validator_value]
    guess = did_you_mean(problem.instance, allowed) if isinstance(problem.instance, str) else None
    hint = f"did you mean {guess}?" if guess else None
    return f"is {display(problem.instance)}; allowed: {', '.join(allowed)}", hint


def _not_constant(problem: Problem) -> _Words:
    return f"must be {display(problem.validator_value)}, not {display(problem.instance)}", None


def _no_match(problem: Problem) -> _Words:
    return f"is {display(problem.instance)}, which does not match {problem.validator_value}", None


def _size(word: str, unit: str) -> Callable[[Problem], _Words]:
    def words(problem: Problem) -> _Words:
        return f"has {len(problem.instance)} {unit}; {word} {problem.validator_value}", None

    return words


def _bound(word: str) -> Callable[[Problem], _Words]:
    def words(problem: Problem) -> _Words:
        return f"is {display(problem.instance, 30)}; {word} {problem.validator_value}", None

    return words


def _not_unique(_: Problem) -> _Words:
    return "has the same item twice", "list each once"


def _any_other(problem: Problem) -> _Words:
    return f"breaks the schema's {display(problem.validator)}", None


_WORDS: dict[str, Callable[[Problem], _Words]] = {
    "type": _wrong_type,
    "enum": _not_listed,
    "const": _not_constant,
    "pattern": _no_match,
    "maxLength": _size("at most", "characters"),
    "minLength": _size("at least", "characters"),
    "maxItems": _size("at most", "items"),
    "minItems": _size("at least", "items"),
    "minimum": _bound("at least"),
    "maximum": _bound("at most"),
    "uniqueItems": _not_unique,
}


def _kind(value: object) -> str:
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "boolean"
    names = {str: "string", int: "number", float: "number", list: "array", dict: "object"}
    return names.get(type(value), type(value).__name__)
