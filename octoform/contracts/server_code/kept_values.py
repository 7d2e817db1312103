"""Which values of a generated server are those of an earlier call: read once, kept where they outlive it, given again.

What outlives a call is state of the module, of a class, of a function's attributes or default arguments, of the
function around a closure that was made once, of the process. A value that each call stores again, as the last term of a
mean, is none that is kept.
"""

import ast
from collections.abc import Iterable, Iterator

from octoform.contracts.server_code.flow import Flow
from octoform.contracts.server_code.origins import SELF, Origin, defaults
from octoform.contracts.server_code.server_source import Function, Source, children, walk

Cell = tuple[object, str]
"""Where a value is kept: what it belongs to (a function, the name of a class, None for the module), and its name."""
_DEPTH = 8
_CACHES = frozenset({"cache", "lru_cache", "cached", "cached_property", "ttl_cache"})
_PASSES = frozenset({"float", "int", "round", "abs", "min", "max"})
_STORES = frozenset(
    {"append", "appendleft", "add", "insert", "extend", "update", "setdefault", "set", "put", "execute"}
)
_MADE_ONCE = (ast.List, ast.Dict, ast.Set, ast.Call, ast.ListComp, ast.DictComp, ast.SetComp)
_PROCESS = frozenset({"os.environ", "globals()", "builtins"})
_THREADS = frozenset({"Thread", "Timer", "Process", "submit", "create_task", "ensure_future", "start_new_thread"})


class Kept:
    """The cells that are filled once, or by somebody else than the call, and what is read of them."""

    def __init__(self, source: Source, flow: Flow) -> None:
        self._source, self._flow = source, flow
        self._named: dict[str, list[Function]] = {}
        for function in source.functions:
            self._named.setdefault(function.name, []).append(function)
        self._once = {source.dotted(call.func) for call, _ in source.calls if source.owner(call) is None}
        self._shared = self._module_names()
        self._late = self._filled_late()

    def holds(self, node: ast.AST | None, depth: int = _DEPTH) -> bool:
        """Whether a value may have been kept."""
        if depth == 0 or node is None:
            return False
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript | ast.Call) and self.cell(node) in self._late:
            return True
        if isinstance(node, ast.Name):
            return any(self.holds(item, depth - 1) for item in self._flow.plain(node))
        if isinstance(node, ast.Call):
            return self._gives(node, depth)
        if isinstance(node, ast.Attribute):
            return any(self._is_kept_by(item, depth) for item in self._properties(node))
        if isinstance(node, ast.Subscript):
            return self.holds(node.value, depth - 1)
        if isinstance(node, ast.IfExp):
            return self.holds(node.body, depth - 1) or self.holds(node.orelse, depth - 1)
        parts = children(node) if isinstance(node, ast.BinOp | ast.BoolOp | ast.UnaryOp | ast.Await) else ()
        return any(self.holds(item, depth - 1) for item in parts)

    def cell(self, node: ast.AST) -> Cell | None:
        """Where that outlives a call the value of a name, or of a chain that begins with one, is kept."""
        attribute = ""
        while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
            if self._source.dotted(node) in _PROCESS:
                return None, self._source.dotted(node)
            attribute = node.attr if isinstance(node, ast.Attribute) else attribute
            node = node.func if isinstance(node, ast.Call) else node.value
        if not isinstance(node, ast.Name):
            return None
        if node.id in SELF:
            return self._member(node, attribute)
        scope = self._flow.bindings.scope(node, node.id)
        if scope is None:
            return (None, node.id) if node.id in self._shared else None
        if any(isinstance(each, _MADE_ONCE) for each in defaults(scope, node.id)):
            return scope, node.id
        inner = self._source.owner(node) is not scope
        return (scope, node.id) if inner and scope.name in self._once else None

    def _member(self, node: ast.AST, attribute: str) -> Cell | None:
        """An attribute of an object that was made once with the module, or of its class."""
        owner = next((item for item in self._around(node) if isinstance(item, ast.ClassDef)), None)
        if owner is None or not attribute:
            return None
        own = [item for item in owner.body if isinstance(item, ast.Assign | ast.AnnAssign)]
        shared = any(isinstance(item.value, _MADE_ONCE) and attribute in _stored(item) for item in own)
        return (owner.name, attribute) if shared or owner.name in self._once else None

    def _around(self, node: ast.AST) -> Iterator[ast.AST]:
        above = self._source.parents.get(node)
        while above is not None:
            yield above
            above = self._source.parents.get(above)

    def _gives(self, call: ast.Call, depth: int) -> bool:
        name = self._source.dotted(call.func)
        if name in _PASSES or name.endswith(".to_thread"):
            return any(self.holds(item, depth - 1) for item in call.args)
        if isinstance(call.func, ast.Name) and self._is_cached(call.func):
            return True
        return any(self._is_kept_by(item, depth) for item in self._entered(call.func))

    def _is_kept_by(self, function: Function | ast.Lambda, depth: int) -> bool:
        if isinstance(function, ast.Lambda):
            return self.holds(function.body, depth - 1)
        marks = {self._source.dotted(_called(item)).rpartition(".")[2] for item in function.decorator_list} & _CACHES
        lasting = bool(marks) and (marks != {"cached_property"} or self._is_member_of_lasting(function))
        if lasting and self._flow.returned(function) & Origin.READ and not self._is_cleared(function.name):
            return True
        return any(self.holds(item, depth - 1) for item in self._flow.results(function))

    def _is_member_of_lasting(self, function: Function) -> bool:
        above = self._source.parents.get(function)
        return isinstance(above, ast.ClassDef) and above.name in self._once

    def _is_cached(self, node: ast.Name) -> bool:
        """``heat = functools.cache(read)`` in the module."""
        for value in self._flow.plain(node):
            made = value if isinstance(value, ast.Call) else None
            if made is None or self._source.dotted(made.func).removesuffix("()").rpartition(".")[2] not in _CACHES:
                continue
            lines = [self._flow.returned(each) for item in made.args for each in self._functions(item)]
            lines += [self._flow.of(item) for item in made.args]
            if any(each & Origin.READ for each in lines) and not self._is_cleared(node.id):
                return True
        return False

    def _is_cleared(self, name: str) -> bool:
        return any(called == f"{name}.cache_clear" for _, called in self._source.calls)

    def _properties(self, node: ast.Attribute) -> list[Function]:
        found = self._named.get(node.attr, ())
        return [
            item
            for item in found
            if any(self._source.dotted(each).endswith("property") for each in item.decorator_list)
        ]

    def _functions(self, node: ast.AST) -> list[Function]:
        return self._named.get(node.id, []) if isinstance(node, ast.Name) else []

    def _entered(self, called: ast.expr) -> list[Function | ast.Lambda]:
        """The functions of the file that a call enters: by name, as a method, as what another one has returned."""
        if isinstance(called, ast.Attribute):
            return [*self._named.get(called.attr, ())]
        if not isinstance(called, ast.Name):
            return []
        found: list[Function | ast.Lambda] = [*self._functions(called)]
        for value in self._flow.plain(called) if not found else ():
            if isinstance(value, ast.Lambda):
                found.append(value)
            elif isinstance(value, ast.Call):
                made = [result for each in self._functions(value.func) for result in self._flow.results(each)]
                found += [each for item in (*made, *value.args) for each in self._functions(item)]
        return found

    def _module_names(self) -> set[str]:
        """The names of the module that are no imports; a class and a function keep what is stored into them."""
        stored = (item for item in self._source.nodes if isinstance(item, ast.Assign | ast.AnnAssign))
        names = {name for item in stored if self._source.owner(item) is None for name in _stored(item)}
        return names | {
            item.name
            for item in self._source.nodes
            if isinstance(item, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef)
        }

    def _filled_late(self) -> set[Cell]:
        """The cells into which something read is put, and not by every call that gives it back."""
        stores: dict[Cell, list[tuple[ast.AST, bool]]] = {}
        for target, values in self._stores():
            if (cell := self.cell(target)) is not None:
                read = any(self._flow.of(each) & Origin.READ for each in values)
                stores.setdefault(cell, []).append((target, read))
        return {
            cell
            for cell, places in stores.items()
            if any(read for _, read in places) and all(self._is_late(place, cell) for place, read in places if read)
        }

    def _stores(self) -> Iterator[tuple[ast.AST, list[ast.expr]]]:
        """(target, values) of each store from within a function."""
        for item in self._source.nodes:
            if self._source.owner(item) is None:
                continue
            if isinstance(item, ast.Assign):
                yield from ((each, [item.value]) for target in item.targets for each in _targets(target))
            elif isinstance(item, ast.Call) and self._source.dotted(item.func) == "setattr" and len(item.args) > 2:
                yield item.args[0], [item.args[2]]
            elif isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr in _STORES:
                yield item.func, [*item.args, *(each.value for each in item.keywords)]

    def _is_late(self, place: ast.AST, cell: Cell) -> bool:
        """Whether a store is behind a look whether there is a value, is skipped in silence, or is a thread's."""
        if isinstance(place, ast.Attribute) and place.attr == "setdefault":
            return True
        below: ast.AST = place
        for above in self._around(place):
            tested = isinstance(above, ast.If | ast.While | ast.IfExp) and below is not above.test
            if tested and self._mentions(above.test, cell):  # type: ignore[attr-defined]
                return True
            skipped = isinstance(above, ast.Try) and self._is_skipped(above, below, cell)
            chosen = isinstance(above, ast.Assign) and self._is_chosen(above.value, cell)
            if skipped or chosen or any(self._is_way_out(item, cell) for item in _before(above, below)):
                return True
            if isinstance(above, ast.FunctionDef | ast.AsyncFunctionDef):
                return self._is_of_a_thread(above, place)
            below = above
        return False

    def _is_chosen(self, value: ast.expr, cell: Cell) -> bool:
        """``kept = kept or read()``"""
        if isinstance(value, ast.IfExp):
            return self._mentions(value.test, cell)
        return isinstance(value, ast.BoolOp) and self._mentions(value.values[0], cell)

    def _is_skipped(self, tried: ast.Try, below: ast.AST, cell: Cell) -> bool:
        """Whether a store is omitted where reading fails, or made where there was no value to give back."""
        if isinstance(below, ast.ExceptHandler):
            return any(self._mentions(item, cell) for item in tried.body)
        leaves = (ast.Raise, ast.Return)
        quiet = [item for item in tried.handlers if not any(isinstance(each, leaves) for each in walk(item))]
        return below in tried.body and any(not self._mentions(item, cell) for item in quiet)

    def _is_way_out(self, statement: ast.stmt, cell: Cell) -> bool:
        """``if name in kept: return kept[name]`` before the store."""
        if not isinstance(statement, ast.If | ast.Try):
            return False
        lines = [statement.test] if isinstance(statement, ast.If) else []
        ends = [item for part in statement.body for item in walk(part) if isinstance(item, ast.Return)]
        return any(self._mentions(item, cell) for item in (*lines, *ends)) and bool(ends)

    def _is_of_a_thread(self, function: Function, place: ast.AST) -> bool:
        """Whether a function that goes on by itself makes the store, so that no one knows when it was made."""
        handed = [
            call
            for call, name in self._source.calls
            if name.rpartition(".")[2] in _THREADS
            for item in (*call.args, *(each.value for each in call.keywords))
            if function.name in {each.id for each in walk(item) if isinstance(each, ast.Name)}
        ]
        again = any(self._source.owner(call) is function for call in handed)
        loops = any(isinstance(above, ast.While) for above, _ in self._source.above(place))
        return bool(handed) and (loops or again)

    def _mentions(self, node: ast.AST, cell: Cell) -> bool:
        for item in walk(node):
            if isinstance(item, ast.Name | ast.Attribute | ast.Subscript) and self.cell(item) == cell:
                return True
            if isinstance(item, ast.Call) and self._source.dotted(item.func) in ("hasattr", "getattr"):
                named = item.args[1] if len(item.args) > 1 else None
                text = str(named.value) if isinstance(named, ast.Constant) else ""
                if isinstance(item.args[0], ast.Name) and item.args[0].id in SELF and text == cell[1]:
                    return True
            if isinstance(item, ast.Name) and any(self._is_of(each, cell) for each in self._flow.plain(item)):
                return True
        return False

    def _is_of(self, node: ast.AST, cell: Cell) -> bool:
        chains = (item for item in walk(node) if isinstance(item, ast.Name | ast.Attribute | ast.Subscript))
        return any(self.cell(item) == cell for item in chains)


def _called(node: ast.expr) -> ast.expr:
    return node.func if isinstance(node, ast.Call) else node


def _targets(target: ast.expr) -> Iterable[ast.expr]:
    return target.elts if isinstance(target, ast.Tuple | ast.List) else [target]


def _stored(statement: ast.Assign | ast.AnnAssign) -> set[str]:
    targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
    return {item.id for target in targets for item in walk(target) if isinstance(item, ast.Name)}


def _before(above: ast.AST, below: ast.AST) -> list[ast.stmt]:
    """The statements of a block that are before one of it."""
    for _, block in ast.iter_fields(above):
        if isinstance(block, list) and below in block:
            return [item for item in block[: block.index(below)] if isinstance(item, ast.stmt)]
    return []
