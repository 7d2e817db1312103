"""A secret that an agent was given must not come back in what it hands over: outputs are committed, secrets never.

Text has more than one spelling: JSON writes any letter as ``\\uXXXX``, and octoform would write it out in clear when
it accepts the value. So the output is also read as the value that it stands for.
"""

import ast
import json
from collections.abc import Iterator, Mapping
from typing import Any

from octoform.diagnostics import Diagnostic, error
from octoform.harness.port import Task

SHORTEST = 8
"""Shorter values are ordinary words (``debug``, ``C.UTF-8``) that an honest output may hold."""


def leaked(task: Task, data: bytes) -> list[Diagnostic]:
    """One error for each secret whose value stands in an output, however it is spelt; the value itself is not told."""
    given = _given(task)
    if not given:
        return []
    said = [data.decode("utf-8", "replace"), *(_literals(data) if task.stage == "serve" else _strings(_value(data)))]
    names = [name for name, value in given.items() if any(value in text for text in said)]
    hint = "an agent must not write what it was given to log in with; the output was taken out of the attempt's folder"
    return [
        error("APPLY-SECRET-IN-OUTPUT", f"the output of {task.stage} holds the value of {name}", hint=hint)
        for name in names
    ]


def _given(task: Task) -> Mapping[str, str]:
    values = {name: task.environment.get(name, "") for name in task.secrets}
    return {name: value for name, value in values.items() if len(value) >= SHORTEST}


def _value(data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None  # the gate refuses it as no JSON; its bytes are looked at all the same


def _strings(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield key
            yield from _strings(item)
    elif isinstance(value, list):
        for item in value:
            yield from _strings(item)


def _literals(data: bytes) -> Iterator[str]:
    try:
        tree = ast.parse(data)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return  # the gate refuses it as no Python
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str | bytes):
            yield node.value if isinstance(node.value, str) else node.value.decode("utf-8", "replace")
