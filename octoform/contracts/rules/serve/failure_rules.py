"""Rules for SERVE about a device that fails: its tool fails too, and does not answer that there is nothing.

An empty list from a sensor that was pulled reads as "nothing happened", and no one looks after it.
"""

import ast
import contextlib
import re
from collections.abc import Iterator
from functools import partial
from typing import Any

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.reading_rules import flow_of_tools
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.server_code.computed_values import CLASS, Failed, Spent, Unsure, World
from octoform.contracts.server_code.failing_evaluator import FAULTS, NEUTRAL, FailingEvaluator, Swallowed
from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.server_evaluator import ways
from octoform.contracts.server_code.server_source import Function, Source, needed_source, walk
from octoform.diagnostics import Diagnostic

CODE = "SERVE-DEFAULT-READING"
_BUDGET, _MAX_WAYS, _MAX_ACCESSES = 60_000, 16, 6
_ABSENCE = re.compile(r"(?i)fail|error|absent|unknown|unavail|missing|none|not|time.?out|offline|lost|gone|silent| ")
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


RULES = (Rule(CODE, nothing_instead),)


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
