"""What in the code of one device's tools can change what belongs to the others, without naming it as its own.

A comparison of statements sees what was rewritten; it doesn't see what rewritten code does when it runs. Reading a
syntax tree can't prove that it does no harm either. So whatever is a way to the names of another function, to modules
under another name, to registered tools or to another device is found here, and held against the accepted server.
"""

import ast
from collections.abc import Iterator, Set

_ATTRIBUTES = frozenset(
    {"__dict__", "__globals__", "__builtins__", "__code__", "__defaults__", "__kwdefaults__", "__closure__"}
    | {"__setattr__", "__delattr__", "__setitem__", "__delitem__", "__subclasses__", "__bases__", "__mro__"}
    | {"__wrapped__", "__class__", "__func__", "__self__", "__loader__", "__spec__", "__import__"}
    | {"f_globals", "f_locals", "f_back", "f_builtins", "gi_frame", "cr_frame", "ag_frame", "tb_frame"}
    | {"_getframe", "_current_frames", "settrace", "setprofile", "modules", "meta_path", "path_hooks"}
    | {"setattr", "delattr", "globals", "vars", "environ", "putenv", "unsetenv"}
)
_MODULES = frozenset({"builtins", "ctypes", "gc", "importlib", "inspect", "unittest", "pkgutil", "runpy", "atexit"})
_CHANGING = frozenset(
    {"clear", "update", "pop", "popitem", "setdefault", "append", "extend", "insert", "remove", "sort", "reverse"}
    | {"add", "discard", "add_tool", "remove_tool", "add_middleware", "mount", "import_server", "disable", "enable"}
)


def reached(node: ast.stmt, shared: Set[str], devices: Set[str]) -> Iterator[tuple[str, ast.AST]]:
    """What a statement reaches for, each with its place: ``shared`` are names of all, ``devices`` the ids of others."""
    names = shared | _aliases(node, shared)
    for item in ast.walk(node):
        if isinstance(item, ast.Attribute) and item.attr in _ATTRIBUTES:
            yield item.attr, item
        elif isinstance(item, ast.Import | ast.ImportFrom):
            yield from ((name, item) for name in sorted(_modules(item) & _MODULES))
        elif isinstance(item, ast.Constant) and isinstance(item.value, str) and item.value in devices:
            yield item.value, item
        if root := _changed(item, names, names - shared):
            yield root, item


def _changed(item: ast.AST, names: Set[str], other: Set[str]) -> str:
    """What is set by one of ``other`` names, or changed by a method of one of ``names``; empty for nothing."""
    if isinstance(item, ast.Attribute | ast.Subscript) and not isinstance(item.ctx, ast.Load):
        return root if (root := chained(item)) in other else ""
    if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr in _CHANGING:
        return f"{root}.{item.func.attr}" if (root := chained(item.func.value)) in names else ""
    return ""


def chained(node: ast.AST) -> str:
    """The name that a chain of attributes and items begins with; empty where it begins with none."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node.id if isinstance(node, ast.Name) else ""


def _modules(node: ast.Import | ast.ImportFrom) -> set[str]:
    if isinstance(node, ast.ImportFrom):
        return {(node.module or "").partition(".")[0]}
    return {item.name.partition(".")[0] for item in node.names}


def _aliases(node: ast.stmt, shared: Set[str]) -> set[str]:
    """Names inside of a function that stand for a module, or for something that belongs to everybody."""
    found: set[str] = set()
    while more := set(_standing(node, shared | found)) - found:
        found |= more
    return found


def _standing(node: ast.stmt, known: Set[str]) -> Iterator[str]:
    """The names that stand for one of ``known`` or for a module."""
    for item in ast.walk(node):
        if item is not node and isinstance(item, ast.Import | ast.ImportFrom):
            yield from (name.asname or name.name.partition(".")[0] for name in item.names)
        elif isinstance(item, ast.Assign | ast.AnnAssign | ast.NamedExpr) and item.value is not None:
            targets = item.targets if isinstance(item, ast.Assign) else [item.target]
            if chained(item.value) in known:
                yield from (target.id for target in targets if isinstance(target, ast.Name))
