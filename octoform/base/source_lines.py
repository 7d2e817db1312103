"""Which lines of a generated server a person has to read: none that is blank, and none that only lists a result."""

import ast


def counted(text: str, tree: ast.Module | None = None) -> list[int]:
    """The numbers of the lines that count, from 1; ``tree`` is the parsed text. SyntaxError for what is no Python.

    A class that has nothing but typed members does not count, nor a TypedDict or NamedTuple that a call makes.
    """
    body = (tree or ast.parse(text)).body
    shapes = {line for item in body if _is_shape(item) for line in range(_first(item), (item.end_lineno or 0) + 1)}
    return [number for number, line in enumerate(text.splitlines(), 1) if line.strip() and number not in shapes]


def _first(node: ast.stmt) -> int:
    """The first line of a statement, decorators included."""
    decorators = node.decorator_list if isinstance(node, ast.ClassDef) else []
    return min([node.lineno, *(each.lineno for each in decorators)])


def _is_shape(node: ast.stmt) -> bool:
    if isinstance(node, ast.ClassDef):
        return all(isinstance(item, ast.AnnAssign | ast.Pass) or _is_text(item) for item in node.body)
    made = node.value.func if isinstance(node, ast.Assign) and isinstance(node.value, ast.Call) else None
    return isinstance(made, ast.Name) and made.id in ("TypedDict", "NamedTuple", "namedtuple")


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
