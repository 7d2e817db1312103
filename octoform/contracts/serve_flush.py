"""How many pictures a generated server takes of a camera that it has opened, up to the one that it keeps."""

import ast
from collections.abc import Iterator

from octoform.contracts.source import Function, Source

GRABS = frozenset({"read", "grab"})
MANY = 1000
"""Where it cannot be told how often a loop runs."""
_DEPTH = 4


def pictures(source: Source, opener: Function) -> int:
    """The number for a function that opens a camera, with what it calls or what calls it; 0 where none is seen."""
    own = _taken(source, opener, _DEPTH)
    if own:
        return own
    callers = {source.owner(call) for call, name in source.calls if name == opener.name}
    counts = [_taken(source, item, _DEPTH) for item in callers if item is not None and item is not opener]
    return min((count for count in counts if count), default=0)


def _taken(source: Source, function: Function, depth: int) -> int:
    """How many pictures one call of a function takes, up to the last one that it uses."""
    taken = kept = 0
    for call in sorted(_calls(source, function), key=lambda item: (item.lineno, item.col_offset)):
        method = call.func.attr if isinstance(call.func, ast.Attribute) else ""
        taken += _of_call(source, call, depth) * _times(source, call, function)
        if (method == "retrieve" or _of_call(source, call, depth)) and not _is_dropped(source, call):
            kept = taken
    return min(kept or taken, MANY)


def _calls(source: Source, function: Function) -> Iterator[ast.Call]:
    return (item for item in ast.walk(function) if isinstance(item, ast.Call) and source.owner(item) is function)


def _of_call(source: Source, call: ast.Call, depth: int) -> int:
    if isinstance(call.func, ast.Attribute) and call.func.attr in GRABS:
        return 1
    own = [item for item in source.functions if item.name == source.dotted(call.func).rpartition(".")[2]]
    return _taken(source, own[0], depth - 1) if depth and len(own) == 1 else 0


def _is_dropped(source: Source, call: ast.Call) -> bool:
    return isinstance(source.parents.get(call), ast.Expr)


def _times(source: Source, node: ast.AST, function: Function) -> int:
    """How often a function runs one of its nodes, by the loops around it."""
    times = 1
    for above, below in source.above(node):
        if above is function:
            break
        if isinstance(above, ast.For | ast.AsyncFor) and below is not above.iter:
            times *= _length(source, above.iter, node)
        elif isinstance(above, ast.ListComp | ast.GeneratorExp | ast.SetComp | ast.DictComp):
            for each in above.generators:
                times *= _length(source, each.iter, node)
        elif isinstance(above, ast.While):
            times *= MANY
    return min(times, MANY)


def _length(source: Source, node: ast.expr, use: ast.AST) -> int:
    if isinstance(node, ast.List | ast.Tuple):
        return len(node.elts)
    if isinstance(node, ast.Call) and source.dotted(node.func) == "range" and len(node.args) == 1:
        count = _number(source, node.args[0], use)
        return MANY if count is None else max(count, 0)
    return MANY


def _number(source: Source, node: ast.expr, use: ast.AST) -> int | None:
    """A whole number that is written here, or that the one assignment to a name of the file gives it."""
    if isinstance(node, ast.Constant):
        return node.value if isinstance(node.value, int) else None
    if not isinstance(node, ast.Name):
        return None
    stored = [
        item
        for item in source.nodes
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store) and item.id == node.id
    ]
    owner = source.owner(use)
    given = owner.args if owner is not None else None
    taken = [*given.posonlyargs, *given.args, *given.kwonlyargs] if given is not None else []
    above = source.parents.get(stored[0]) if len(stored) == 1 else None
    if any(item.arg == node.id for item in taken) or not isinstance(above, ast.Assign | ast.AnnAssign):
        return None
    return _number(source, above.value, use) if isinstance(above.value, ast.Constant) else None
