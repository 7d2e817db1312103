"""What protects the hardware in the functions of a tool, and what of it a rewrite has lost.

Limits are enforced outside of the server too; these are the checks, locks, bounds and timeouts of its own code. Reading
code cannot prove that a rewrite is harmless. It can tell what was there and is there no more, or reads differently, and
a repair that has to change such a thing is a person's to make.
"""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator

from octoform.contracts.text import listed, shown
from octoform.diagnostics import Diagnostic, error

CODE = "HEAL-WEAKENS"
_ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_BOUNDING = frozenset({"min", "max", "clamp", "clip"})
_TIMED = ("timeout", "deadline", "patience", "max", "min", "limit", "ge", "le", "gt", "lt", "maximum", "minimum")
_HINT = "keep every check, bound, lock, timeout and error as it is; a limit that is in the way is for a person to move"


def lost(before: Iterable[ast.stmt], after: Iterable[ast.stmt]) -> list[Diagnostic]:
    """What protects in the statements ``before``, and is missing or fewer in ``after``; and errors newly swallowed."""
    old, new = list(before), list(after)
    had, has = Counter(_protections(old)), Counter(_protections(new))
    missing = sorted((had - has).elements())
    found = []
    if missing:
        summary = f"the rewrite has lost what protects: {listed([shown(item) for item in missing])}"
        found.append(error(CODE, summary, path="server.py", hint=_HINT))
    if _swallowed(new) > _swallowed(old):
        summary = "the rewrite catches an error and does not raise one, which would hide the fault"
        found.append(error(CODE, summary, path="server.py", hint="let the error reach the caller, in one sentence"))
    return found


def _protections(statements: Iterable[ast.stmt]) -> Iterator[str]:
    for node in _walked(statements):
        if isinstance(node, ast.If) and _refuses(node.body):
            yield f"if {ast.unparse(node.test)}: raise"
        elif isinstance(node, ast.Assert):
            yield f"assert {ast.unparse(node.test)}"
        elif isinstance(node, ast.Raise):
            yield f"raise {_kind(node.exc)}"
        elif isinstance(node, ast.Compare) and any(isinstance(item, _ORDER) for item in node.ops):
            yield ast.unparse(node)
        elif isinstance(node, ast.With | ast.AsyncWith):
            yield from (f"with {ast.unparse(item.context_expr)}" for item in node.items)
        elif isinstance(node, ast.Call):
            yield from _bounds(node)


def _bounds(call: ast.Call) -> Iterator[str]:
    """A call that bounds a value, and the numbers that bound what is called."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in _BOUNDING:
        yield ast.unparse(call)
    for item in call.keywords:
        if item.arg is not None and _is_bound(item.arg) and _number(item.value):
            yield f"{item.arg}={ast.unparse(item.value)}"


def _is_bound(name: str) -> bool:
    return any(part in _TIMED for part in name.lower().split("_"))


def _number(node: ast.expr) -> bool:
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


def _refuses(body: list[ast.stmt]) -> bool:
    return any(isinstance(item, ast.Raise) for item in body)


def _kind(node: ast.expr | None) -> str:
    """The class of what is raised; empty where an error is raised again."""
    return ast.unparse(node.func if isinstance(node, ast.Call) else node) if node is not None else ""


def _swallowed(statements: Iterable[ast.stmt]) -> int:
    """Handlers that raise nothing, and blocks that suppress errors."""
    count = 0
    for node in _walked(statements):
        if isinstance(node, ast.ExceptHandler):
            count += not any(isinstance(item, ast.Raise) for item in _walked(node.body))
        elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] == "suppress":
            count += 1
    return count


def _walked(statements: Iterable[ast.stmt]) -> Iterator[ast.AST]:
    for statement in statements:
        yield from ast.walk(statement)
