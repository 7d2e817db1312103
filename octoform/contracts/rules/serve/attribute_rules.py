"""Rules for SERVE about names and times in a result: each is of the attribute that it is called after, or measured.

The calls are computed with attributes whose text is their own name, so that a result shows what each member is read of.
"""

import ast
import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.name_clues import tokens
from octoform.contracts.rules.serve.computed_calls import Calls, arguments, records
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions, turns_pictures
from octoform.contracts.rules.serve.value_rules import stored_members
from octoform.contracts.server_code.computed_values import CLASS, Failed, Place, Spent, Unsure, World, is_unknown
from octoform.contracts.server_code.origins import Origin, last
from octoform.contracts.server_code.server_evaluator import Evaluator
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

OTHERWISE, CONSTANT = "SERVE-READING-OTHERWISE", "SERVE-CONSTANT-READING"
_BUDGET = 40_000
_SIGN = "\N{WHITE SQUARE}"
_OF_ONE = regex(r"(?:^|_)(?:serial|uuid|asset_tag)(?:$|_)")
_NAMES = regex(
    r"(?:sys|board|bios|chassis)_vendor|(?:product|board)_name|(?:product|board|bios|chassis)_version|product_family"
    r"|bios_date|manufacturer|model_name|firmware_(?:version|rev)"
)
"""Members that are named as the kernel names an attribute, whose text is a fact of the unit at hand."""
_MEASURED = regex(r"(?:^|_)(?:waited|elapsed|took)(?:$|_)")


@dataclass
class _Signs(World):
    """Attributes whose text is their own name."""

    def text(self, place: Place) -> Any:
        found = super().text(place)
        named = is_unknown(found) or place.key[1:2] == ("dmi",)
        return f"{_SIGN}{place.key[-1]}{_SIGN}" if named and len(place.key) > 2 else found


def read_of_another(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A member that is called like an attribute is that attribute, and no other one; a serial number is no name."""
    source = needed_source(value)
    hint = "read the attribute that the member is called after"
    out = []
    for tool, function, found in _results(value, artifacts):
        for what in dict.fromkeys(each for record in found for each in _exchanged(record)):
            out.append(source.problem(OTHERWISE, function, f"{display(tool)} returns {what}", hint))
    return out


def written_text(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A member that is called like an attribute of the kernel is read, and no text of the file."""
    source = needed_source(value)
    hint = "read the attribute of that name in the folder of the device"
    out = []
    for _, function, found in _results(value, artifacts):
        for record in found:
            for name, each in record.items():
                if isinstance(each, str) and each and _SIGN not in each and name != CLASS and _NAMES.fullmatch(name):
                    what = f"the result's {display(name)} is a string of this file, and not one that the device gave"
                    out.append(source.problem(CONSTANT, function, what, hint))
    return out


def repeated_time(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """How long a call waited was measured: it is not how long it was to wait."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "measure it: time.monotonic() after the wait less the one before"
    stored = [(node, name, each) for node, members in stored_members(source).items() for name, each in members]
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        used = source.entered_from(tool_functions(source, site))
        sleeps = any(source.owner(call) in used and name.endswith("sleep") for call, name in source.calls)
        for node, name, each in stored:
            if source.owner(node) in used and not sleeps and _MEASURED.search(name):
                values = (flow.plain(each) if isinstance(each, ast.Name) else []) or [each]
                if all(flow.of(item) == Origin.ARGUMENT for item in values):
                    summary = f"{display(tool['name'])} returns its argument as {display(name)}"
                    out.setdefault(each, source.problem(CONSTANT, each, summary, hint))
    return list(out.values())


_OPPOSITES = tuple(
    (frozenset(one.split()), frozenset(two.split()))
    for one, two in (
        ("width columns cols", "height rows"),
        ("min minimum low lowest lower least lcrit", "max maximum high highest upper most crit"),
        ("x", "y"),
        ("left", "right"),
        ("first start begin", "last end"),
    )
)


def members_exchanged(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """Of two opposite members each has its own value: the width is not the height."""
    source = needed_source(value)
    returned = {name for _, tool in served_tools(source, artifacts) for name in _members(tool.get("output_schema"))}
    hint = "give each member the value of its own name"
    opposites = _OPPOSITES[1:] if turns_pictures(source) else _OPPOSITES  # the first are the sides of a picture
    out = []
    for node, members in _records(source).items():
        known = [(name, {*tokens(name)}, each) for name, each in members.items() if name in returned]
        for one, two in opposites:
            firsts = [(name, spoken - one, each) for name, spoken, each in known if spoken & one]
            seconds = [(name, spoken - two, each) for name, spoken, each in known if spoken & two]
            for (first, rest, mine), (second, same, its) in itertools.product(firsts, seconds):
                if first == second or rest != same:
                    continue
                if _shows(source, mine, one, two) == 2 and _shows(source, its, one, two) == 1:
                    summary = f"{display(first)} and {display(second)} have each other's value"
                    out.append(source.problem(OTHERWISE, node, summary, hint))
    return out


RULES = (
    Rule(OTHERWISE, members_exchanged),
    Rule(OTHERWISE, read_of_another),
    Rule(CONSTANT, written_text),
    Rule(CONSTANT, repeated_time),
)


def _members(schema: Any) -> Iterator[str]:
    """The names of all members of a result, at any depth."""
    for item in schema if isinstance(schema, list) else schema.values() if isinstance(schema, dict) else ():
        yield from _members(item)
    members = schema.get("properties") if isinstance(schema, dict) else None
    yield from members if isinstance(members, dict) else ()


def _records(source: Source) -> dict[ast.AST, dict[str, ast.expr]]:
    """The members of each record that the file makes or changes, also by an assignment to several targets."""
    found: dict[ast.AST, dict[str, ast.expr]] = {
        node: dict(members) for node, members in stored_members(source).items()
    }
    for node in source.by_kind[ast.Assign]:
        target = node.targets[0] if isinstance(node, ast.Assign) else None
        if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
            keys = [getattr(getattr(each, "slice", None), "value", None) for each in target.elts]
            pairs = zip(keys, node.value.elts, strict=False)
            found[node] = {key: each for key, each in pairs if isinstance(key, str)}
    return {node: each for node, each in found.items() if len(each) > 1}


def _shows(source: Source, node: ast.expr, one: frozenset[str], two: frozenset[str], depth: int = 4) -> int:
    """Which of two opposites the names in a value speak of: 1 or 2; 0 where they speak of neither, or of both."""
    found: set[int] = set()
    if any(_turns(source, item) for item in walk(node)):
        return 0
    for item in walk(node):
        if isinstance(item, ast.Name):
            found.add(_bound(source, item, one, two, depth) or _of_words(item.id, one, two))
        elif isinstance(item, ast.Subscript):
            found.add(_at(item, one))
        else:
            text = (
                item.attr if isinstance(item, ast.Attribute) else item.value if isinstance(item, ast.Constant) else ""
            )
            found.add(_of_words(text, one, two) if isinstance(text, str) else 0)
    found.discard(0)
    return found.pop() if len(found) == 1 else 0


_TURNING = frozenset({"pow", "reciprocal", "truediv", "sub", "neg"})
"""Functions of libraries that may do so."""


def _turns(source: Source, node: ast.AST) -> bool:
    """Whether a value falls as a part of it grows, as `1 / rate` and `-level` do: the least comes of the most then."""
    if isinstance(node, ast.Call):
        own = [each for each in source.functions if each.name == last(node.func)]
        return last(node.func) in _TURNING or any(_falls(item) for each in own for item in walk(each))
    return _falls(node)


def _falls(node: ast.AST) -> bool:
    """Whether an operation subtracts a part that has a name, divides by it, or takes a power of it below nothing."""
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        part = node.operand
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub | ast.Div | ast.FloorDiv):
        part = node.right
    elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow) and isinstance(node.right, ast.UnaryOp):
        part = node.left
    else:
        return False
    return not isinstance(part, ast.JoinedStr) and any(isinstance(item, ast.Name) for item in walk(part))


def _of_words(text: str, one: frozenset[str], two: frozenset[str]) -> int:
    words = {*tokens(text)}
    return 0 if bool(words & one) == bool(words & two) else 1 if words & one else 2


def _at(node: ast.Subscript, one: frozenset[str]) -> int:
    """The side of a picture, or the end of a sorted list, that is at a place."""
    place = node.slice
    minus = isinstance(place, ast.UnaryOp) and isinstance(place.op, ast.USub)
    at = place.operand if isinstance(place, ast.UnaryOp) else place
    number = at.value if isinstance(at, ast.Constant) and type(at.value) is int else None
    if number is None:
        return 0
    if isinstance(node.value, ast.Attribute) and node.value.attr == "shape" and "width" in one and not minus:
        return _has_no_call(node.value) and {0: 2, 1: 1}.get(number, 0)
    if isinstance(node.value, ast.Call) and getattr(node.value.func, "id", "") == "sorted" and "min" in one:
        return 0 if node.value.keywords else 1 if number == 0 and not minus else 2 if number == 1 and minus else 0
    return 0


def _has_no_call(node: ast.AST) -> bool:
    return not any(isinstance(item, ast.Call) for item in walk(node))


def _bound(source: Source, name: ast.Name, one: frozenset[str], two: frozenset[str], depth: int) -> int:
    """What a name was bound to, where that is one thing of one side: rows, columns = frame.shape[:2]."""
    owner = source.owner(name)
    sites = [item for item in walk(owner) if isinstance(item, ast.Assign)] if owner is not None and depth else []
    found = set()
    for item in sites:
        for target in item.targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            for at, each in enumerate(names):
                if isinstance(each, ast.Name) and each.id == name.id:
                    found.add(
                        _taken(source, item.value, at if isinstance(target, ast.Tuple) else None, (one, two), depth)
                    )
    return found.pop() if len(found) == 1 else 0


def _taken(
    source: Source, value: ast.expr, at: int | None, words: tuple[frozenset[str], frozenset[str]], depth: int
) -> int:
    """The side of a value, or of its part at a place."""
    if at is None:
        return _shows(source, value, *words, depth - 1)
    if isinstance(value, ast.Tuple) and at < len(value.elts):
        return _shows(source, value.elts[at], *words, depth - 1)
    cut = value.slice if isinstance(value, ast.Subscript) else None
    plain = isinstance(cut, ast.Slice) and cut.lower is None and cut.step is None
    whole = value.value if plain and isinstance(value, ast.Subscript) else value
    if isinstance(whole, ast.Attribute) and whole.attr == "shape" and "width" in words[0] and _has_no_call(whole):
        return {0: 2, 1: 1}.get(at, 0)
    return 0


def _results(value: str, artifacts: Artifacts) -> Iterator[tuple[str, Function, list[dict[Any, Any]]]]:
    """(tool, its function, the records of its result) of each read tool that returns texts, where there is one way."""
    source = needed_source(value)
    calls, left = Calls(source, artifacts), [_BUDGET]
    for tool, function in calls.served.values():
        if tool["effect"] != "read" or '"string"' not in str(tool.get("output_schema")).replace("'", '"'):
            continue
        try:
            call = Evaluator(source, _Signs(lambda _: 500.0, left), [], lambda *_: True)
            found = list(records(call.call(function, next(arguments(tool, tool["devices"][0])))))
        except (Failed, Unsure):
            continue
        except Spent:
            return
        if not call.taken:
            yield tool["name"], function, found


def _exchanged(record: dict[Any, Any]) -> Iterator[str]:
    """The members of a record that have the text of another member's attribute, or a serial number's."""
    for name, each in record.items():
        attribute = each.strip().strip(_SIGN) if isinstance(each, str) and each.strip()[:1] == _SIGN else ""
        if not attribute or name in (attribute, CLASS) or _SIGN in attribute:
            continue
        if attribute in record:
            yield f"{display(attribute)} as {display(name)}, which is another member"
        elif _OF_ONE.search(attribute) and not _OF_ONE.search(str(name)):
            yield f"{display(attribute)}, which names one unit, as {display(name)}"
