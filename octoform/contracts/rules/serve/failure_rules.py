"""Rules for SERVE about a device that fails: its tool fails too, and does not answer that there is nothing.

An empty list from a sensor that was pulled reads as "nothing happened", and no one looks after it.
"""

import ast
import contextlib
import itertools
import re
from collections.abc import Iterator
from functools import partial
from typing import Any

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.rules.serve.value_rules import stored_members
from octoform.contracts.server_code.computed_values import CLASS, Failed, Spent, Unsure, World
from octoform.contracts.server_code.failing_evaluator import FAULTS, NEUTRAL, FailingEvaluator, Swallowed
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import ADDS, Origin
from octoform.contracts.server_code.server_evaluator import ways
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

CODE = "SERVE-DEFAULT-READING"
_BUDGET, _MAX_WAYS, _MAX_ACCESSES = 60_000, 16, 6
_ABSENCE = regex(r"(?i)fail|error|absent|unknown|unavail|missing|none|not|time.?out|offline|lost|gone|silent| ")
"""Words by which a result reports that a reading is not there."""


def nothing_instead(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool of effect ``read`` whose device fails raises an error: it does not answer with nothing."""
    source = needed_source(value)
    if not (source.by_kind[ast.ExceptHandler] or "suppress" in value):
        return []
    flow = flow_of_tools(source, artifacts)
    hint = "let the error pass, or raise ToolError with what failed; a loop may skip one that fails, and raises where "
    hint += "none was read; None alone may stand for an attribute that a driver can lack"
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        functions = tool_functions(source, site) if tool["effect"] == "read" else []
        if not any(_may_swallow(source, each) for each in functions):
            continue
        for by in _answers(source, flow, tool, functions[0]) if len(functions) == 1 else ():
            summary = f"where its device fails, {display(tool['name'])} answers with nothing, as if it had been read"
            out.setdefault(by.node, source.problem(CODE, by.node, summary, hint))
    return list(out.values())


_FAILED = regex(r"(?i)(?:^|_)(?:unread\w*|fail\w*|errors?|missing|unavailable|skipped|silent|absent|dead)(?:$|_)")
"""Members of a result that list what gave no reading."""


def failed_unlisted(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """What a tool skips because it failed is in the list that INTERFACE has for that: the list is not always empty."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "add the name of what is skipped to the list, or let the error pass"
    out: dict[ast.AST, Diagnostic] = {}
    for site, tool in served_tools(source, artifacts):
        lists = [name for name in _arrays(tool.get("output_schema")) if _FAILED.search(name)]
        used = source.entered_from(tool_functions(source, site)) if lists and tool["effect"] == "read" else []
        parts = [item for each in used for item in walk(each)]
        for skipped in itertools.islice(_skips(source, flow, parts), 0 if _compares_lengths(source, parts) else 1):
            for name in lists:
                stored = [each for node in parts for key, each in stored_members(source).get(node, ()) if key == name]
                empty = bool(stored) and all(_stays_empty(source, flow, each) for each in stored)
                if empty and not _is_filled(source, parts, name):
                    summary = f"{display(name)} is always empty in {display(tool['name'])}, and what fails here is "
                    out.setdefault(skipped, source.problem(CODE, skipped, f"{summary}skipped", hint))
    return list(out.values())


RULES = (Rule(CODE, nothing_instead), Rule(CODE, failed_unlisted))


def _arrays(schema: Any) -> Iterator[str]:
    """The members of a result that are lists, at its top."""
    members = schema.get("properties") if isinstance(schema, dict) else None
    for name, member in members.items() if isinstance(members, dict) else ():
        if isinstance(member, dict) and member.get("type") == "array":
            yield name


def _skips(source: Source, flow: Flow, parts: list[ast.AST]) -> Iterator[ast.AST]:
    """Where a loop skips an item that fails: in a handler, or by a test for None."""
    for item in parts:
        if isinstance(item, ast.Try) and _is_of_each(source, item):
            yield from (each for each in item.handlers if _goes_on(each, item))
        elif isinstance(item, ast.With) and _is_of_each(source, item):
            yield from [item] if _suppresses(source, item) and _makes(item.body) else []
        elif isinstance(item, ast.If) and _is_of_each(source, item):
            absent = _tested(flow, item.test, ast.Is) and isinstance(item.body[-1], ast.Continue)
            there = _tested(flow, item.test, ast.IsNot) and not item.orelse and _makes(item.body)
            yield from [item] if absent or there else []
        elif isinstance(item, ast.comprehension):
            yield from (test for test in item.ifs if _tested(flow, test, ast.IsNot))


def _compares_lengths(source: Source, parts: list[ast.AST]) -> bool:
    """Whether an error follows from a comparison of two lengths: of what was read with what there is."""
    for item in parts:
        if isinstance(item, ast.If) and isinstance(item.test, ast.Compare):
            sides = (item.test.left, *item.test.comparators)
            lengths = [each for each in sides if isinstance(each, ast.Call) and source.dotted(each.func) == "len"]
            if len(lengths) > 1 and any(isinstance(each, ast.Raise) for each in walk(item)):
                return True
    return False


def _is_of_each(source: Source, node: ast.AST) -> bool:
    """Whether a statement is about the item of a loop that goes through all items."""
    loop = next((above for above, _ in source.above(node) if isinstance(above, ast.For | ast.While)), None)
    if not isinstance(loop, ast.For) or any(isinstance(item, ast.Break | ast.Return) for item in walk(loop)):
        return False
    names = {item.id for item in walk(loop.target) if isinstance(item, ast.Name)}
    inside = {item.id for part in loop.body for item in walk(part) if isinstance(item, ast.Name)}
    return bool(names & inside)


def _goes_on(handler: ast.ExceptHandler, node: ast.Try) -> bool:
    """Whether a handler skips the item, and adds it to no list."""
    parts = list(walk(handler))
    if any(isinstance(item, ast.Raise) or (isinstance(item, ast.Call) and _fills(item)) for item in parts):
        return False
    return any(isinstance(item, ast.Continue) for item in parts) or (
        all(isinstance(item, ast.Pass | ast.Expr) for item in handler.body) and _makes(node.body)
    )


def _fills(call: ast.Call) -> bool:
    return isinstance(call.func, ast.Attribute) and call.func.attr in ADDS


def _makes(body: list[ast.stmt]) -> bool:
    """Whether statements add an item to a collection."""
    parts = [item for each in body for item in walk(each)]
    calls = any(isinstance(item, ast.Call) and _fills(item) for item in parts)
    return calls or any(isinstance(item, ast.Yield | ast.AugAssign) for item in parts)


def _suppresses(source: Source, node: ast.With) -> bool:
    calls = (item.context_expr for item in node.items)
    return any(isinstance(call, ast.Call) and source.dotted(call.func).endswith("suppress") for call in calls)


def _tested(flow: Flow, test: ast.expr, kind: type[ast.cmpop]) -> bool:
    """Whether a test distinguishes a reading that is None."""
    if not isinstance(test, ast.Compare) or not isinstance(test.ops[0], kind) or len(test.ops) > 1:
        return False
    none = isinstance(test.comparators[0], ast.Constant) and test.comparators[0].value is None
    named = test.left.target if isinstance(test.left, ast.NamedExpr) else test.left
    label = isinstance(named, ast.Name) and re.search(r"label|name|text|unit", named.id)
    return none and not label and bool(flow.of(test.left) & (Origin.READ | Origin.SYSTEM))


def _stays_empty(source: Source, flow: Flow, node: ast.expr) -> bool:
    """Whether a list is written as empty, and nothing is added to it by its name."""
    if isinstance(node, ast.List | ast.Tuple):
        return not node.elts
    if isinstance(node, ast.Call):
        return source.dotted(node.func) in ("list", "tuple") and not node.args
    owner = source.owner(node)
    if not isinstance(node, ast.Name) or owner is None:
        return False
    uses = [item for item in walk(owner) if isinstance(item, ast.Name) and item.id == node.id]
    values = flow.plain(node)
    known = bool(values) and all(isinstance(each, ast.expr) and _stays_empty(source, flow, each) for each in values)
    return known and len(uses) == 1 + len(values)


def _is_filled(source: Source, parts: list[ast.AST], name: str) -> bool:
    """Whether something is added to this member of a result after it was made."""
    for item in parts:
        texts = isinstance(item, ast.Subscript) and isinstance(item.slice, ast.Constant) and item.slice.value == name
        if (texts or (isinstance(item, ast.Attribute) and item.attr == name)) and not isinstance(
            source.parents.get(item), ast.Return
        ):
            return True
    return False


def _answers(source: Source, flow: Flow, tool: JsonObject, function: Function) -> Iterator[Swallowed]:
    """What lets a tool answer with nothing while its device fails: from its first access on, or from a later one."""
    left, given = [_BUDGET], _given(tool)

    def failing(fault: tuple[str, int], choices: list[bool]) -> FailingEvaluator:
        return FailingEvaluator(source, World(lambda _: 0.0, left), choices, flow, fault)

    for kind in FAULTS:
        for spared in range(_MAX_ACCESSES):
            failed = False
            for call in ways(partial(failing, (kind, spared)), _MAX_WAYS):
                try:
                    with contextlib.suppress(Failed, Unsure):
                        result = call.call(function, given)
                        if call.swallowed and _is_nothing(result, call.swallowed, [*given.values()]):
                            yield call.swallowed[-1]
                            return
                except Spent:
                    return
                failed = failed or call.failed
            if not failed:
                break


def _may_swallow(source: Source, function: Function) -> bool:
    """Whether something that a tool enters, or that the file puts around it, can catch an error."""
    entered = source.entered_from([function])
    own = {each.name for each in source.functions}
    if any(
        own & {name.id for name in ast.walk(item) if isinstance(name, ast.Name)}
        for each in entered
        for item in each.decorator_list
    ):
        return True
    parts = (item for each in entered for item in walk(each))
    return any(
        isinstance(item, ast.ExceptHandler)
        or (isinstance(item, ast.Call) and source.dotted(item.func).endswith("suppress"))
        for item in parts
    )


def _given(tool: JsonObject) -> dict[str, Any]:
    """An argument for each parameter: the tested one, the default, or what is unknown and the caller's."""
    smoke = tool.get("smoke", {}).get("arguments", {})
    out: dict[str, Any] = {}
    for name, member in (tool["input_schema"].get("properties") or {}).items():
        usual = member.get("default", NEUTRAL) if isinstance(member, dict) else NEUTRAL
        out[name] = tool["devices"][0] if name == "device" else smoke.get(name, usual)
    return out


def _is_nothing(result: Any, swallowed: list[Swallowed], given: list[Any]) -> bool:
    """Whether a result has none of what the device was asked for.

    None alone is what an attribute is that the driver lacks, where each was asked for by itself.
    """
    leaves = list(_leaves(result))
    if not all(_is_empty(item) or item is NEUTRAL or item in given or _is_label(item) for item in leaves):
        return False
    empty = [item for item in leaves if _is_empty(item)]
    if any(item is not None for item in empty) or result is None:
        return True
    return bool(empty) and (any(each.everything for each in swallowed) or len(swallowed) < len(empty))


def _is_empty(value: Any) -> bool:
    return value is None or (isinstance(value, str | bytes | list | tuple | dict | set) and not value)


def _is_label(value: Any) -> bool:
    """A unit, a name or a count of nothing, which the file has beside a reading."""
    if isinstance(value, str):
        return not _ABSENCE.search(value)
    return type(value) in (int, float) and value == 0


def _leaves(value: Any) -> Iterator[Any]:
    """The values of a result that are no records, at any depth."""
    if isinstance(value, dict) and value:
        for name, each in value.items():
            yield from _leaves(each) if name != CLASS else ()
    elif isinstance(value, list | tuple) and value:
        for each in value:
            yield from _leaves(each)
    else:
        yield value
