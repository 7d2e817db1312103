"""Where the names of a generated server get their values: every binding, and those that reach one use of a name.

A tool may bind a name, read a device into it and bind it again; what it returns is the last of these. So a binding that
stands on every way to a use hides the ones before it. What cannot be told reaches the use.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from octoform.contracts.source import Function, Source

Place = tuple[int, int]
_LOOPS = (ast.For, ast.AsyncFor, ast.While)
_ASKS = frozenset({"get", "index", "count", "format", "join", "split", "startswith", "endswith", "encode", "replace"})
"""Methods that leave what they belong to as it is."""
_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")


@dataclass(frozen=True, eq=False, slots=True)
class Binding:
    """One way in which a name gets a value, or what it stands for is changed.

    ``value`` is what flows in. ``whole``: the name stands for that and nothing else afterwards. ``counts``: the value
    is added to what was there; ``fills``: a call is given the name, and may fill what it stands for.
    """

    node: ast.AST
    value: ast.AST
    whole: bool = True
    counts: bool = False
    fills: bool = False

    @property
    def place(self) -> Place:
        """Line and column."""
        return getattr(self.node, "lineno", 0), getattr(self.node, "col_offset", 0)


class Bindings:
    """All bindings of a file, by the function in which they hold; None is the module."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._of: dict[Function | None, dict[str, list[Binding]]] = defaultdict(lambda: defaultdict(list))
        self.attributes: dict[str, list[Binding]] = defaultdict(list)
        self._parameters = {
            function: frozenset(item.arg for item in arguments(function)) for function in source.functions
        }
        shared = {
            (source.owner(item), name)
            for item in source.nodes
            if isinstance(item, ast.Global | ast.Nonlocal)
            for name in item.names
        }
        found = [(source.owner(item), name, each) for item in source.nodes for name, each in _bound(item)]
        local = {(owner, name) for owner, name, each in found if each.whole} - shared
        for owner, name, each in found:
            own = owner is None or (owner, name) in local or name in self._parameters[owner]
            home = owner if own else self._home(owner, name, local)
            self._of[home][name].append(each)
        for item in source.nodes:
            self._add_attributes(item)

    def of(self, scope: Function | None, name: str) -> list[Binding]:
        """The bindings of a name in one scope."""
        return self._of[scope].get(name, []) if scope in self._of else []

    def scope(self, node: ast.AST, name: str) -> Function | None:
        """The innermost function around ``node`` in which the name is bound; None for the module, or for nowhere."""
        owner = self._source.owner(node)
        while owner is not None:
            if self.of(owner, name) or name in self._parameters[owner]:
                return owner
            owner = self._source.owner(owner)
        return None

    def is_parameter(self, scope: Function | None, name: str) -> bool:
        """Whether a function takes a name from its caller."""
        return scope is not None and name in self._parameters[scope]

    def reaching(self, use: ast.Name) -> tuple[list[Binding], bool]:
        """The bindings of which one gives the name its value here, and whether a parameter's may still hold."""
        scope = self.scope(use, use.id)
        every = self.of(scope, use.id)
        if self._source.owner(use) is not scope or scope is None:
            return every, True
        chain = [use, *(above for above, _ in self._source.above(use))]
        sure = [each for each in every if each.whole and self._is_before(each, use, chain)]
        last = max((each.place for each in sure), default=(0, 0))
        at = (use.lineno, use.col_offset)
        loops: set[ast.AST] = {item for item in chain if isinstance(item, _LOOPS)}
        kept = [
            each
            for each in every
            if each.place >= last and (each.place < at or self._shares(each.node, loops)) and each.node not in chain[:1]
        ]
        return kept, not sure

    def _is_before(self, binding: Binding, use: ast.AST, chain: list[ast.AST]) -> bool:
        """Whether a binding stands on every way to a use: before it, in a block that encloses it."""
        statement: ast.AST | None = binding.node
        while statement is not None and not isinstance(statement, ast.stmt | ast.match_case):
            if isinstance(statement, ast.IfExp | ast.BoolOp | ast.Lambda | ast.comprehension):
                return False
            statement = self._source.parents.get(statement)
        if statement is None or statement is use:
            return False
        if statement in chain:  # a `with`, a loop or a case that binds for its body
            return isinstance(statement, ast.stmt | ast.match_case) and self._in_body(statement, chain)
        above = self._source.parents.get(statement)
        beside = next((item for item in chain if self._source.parents.get(item) is above), None)
        if above is None or beside is None:
            return False
        for name in _BLOCKS:
            block = getattr(above, name, None)
            if isinstance(block, list) and statement in block and beside in block:
                return block.index(statement) < block.index(beside)
        return False

    def _in_body(self, statement: ast.AST, chain: list[ast.AST]) -> bool:
        body = getattr(statement, "body", [])
        return isinstance(body, list) and any(item in body for item in chain)

    def _shares(self, node: ast.AST, loops: set[ast.AST]) -> bool:
        return any(above in loops for above, _ in self._source.above(node))

    def _home(self, owner: Function | None, name: str, local: set[tuple[Function | None, str]]) -> Function | None:
        """The scope whose name a function changes without binding it."""
        while owner is not None:
            owner = self._source.owner(owner)
            if owner is not None and ((owner, name) in local or name in self._parameters[owner]):
                return owner
        return None

    def _add_attributes(self, node: ast.AST) -> None:
        """What is stored into attributes, and the fields of classes."""
        for target, value in _pairs(node):
            for item in ast.walk(target):
                if isinstance(item, ast.Attribute) and isinstance(item.ctx, ast.Store):
                    self.attributes[item.attr].append(Binding(node, value))
        if isinstance(node, ast.ClassDef):
            for statement in node.body:
                for target, value in _pairs(statement):
                    if isinstance(target, ast.Name):
                        self.attributes[target.id].append(Binding(statement, value))


def arguments(function: Function | ast.Lambda) -> list[ast.arg]:
    """All parameters of a function, in their order."""
    given = function.args
    stars = [item for item in (given.vararg, given.kwarg) if item is not None]
    return [*given.posonlyargs, *given.args, *given.kwonlyargs, *stars]


def defaults(function: Function, name: str) -> list[ast.expr]:
    """The default of a parameter; empty where it has none."""
    given = [*function.args.posonlyargs, *function.args.args]
    values = function.args.defaults
    pairs = [*zip(given[len(given) - len(values) :], values, strict=True)]
    pairs += [(one, two) for one, two in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True) if two]
    return [value for item, value in pairs if item.arg == name]


def _pairs(node: ast.AST) -> Iterator[tuple[ast.expr, ast.expr]]:
    """(target, value) of each binding of a statement."""
    if isinstance(node, ast.Assign):
        yield from ((target, node.value) for target in node.targets)
    elif isinstance(node, ast.AnnAssign | ast.AugAssign) and node.value is not None:
        yield node.target, node.value
    elif isinstance(node, ast.For | ast.AsyncFor):
        yield node.target, node.iter
    elif isinstance(node, ast.NamedExpr):
        yield node.target, node.value
    elif isinstance(node, ast.With | ast.AsyncWith):
        yield from ((item.optional_vars, item.context_expr) for item in node.items if item.optional_vars is not None)


def _bound(node: ast.AST) -> Iterator[tuple[str, Binding]]:
    """(name, binding) of everything that a node binds, or may change."""
    for target, value in _pairs(node):
        added = isinstance(node, ast.AugAssign)
        for one, own in _unpacked(target, value):
            yield from _named(node, one, own, added)
    if isinstance(node, ast.ExceptHandler) and node.name:
        yield node.name, Binding(node, node)
    elif isinstance(node, ast.MatchAs | ast.MatchStar) and node.name:
        yield node.name, Binding(node, node, whole=False)
    elif isinstance(node, ast.MatchMapping) and node.rest:
        yield node.rest, Binding(node, node, whole=False)
    elif isinstance(node, ast.Call):
        yield from _changed(node)


def _unpacked(target: ast.expr, value: ast.expr) -> Iterator[tuple[ast.expr, ast.expr]]:
    """The pairs of ``a, b = x, y``; what cannot be told apart stays together."""
    names = target.elts if isinstance(target, ast.Tuple | ast.List) else []
    values = value.elts if isinstance(value, ast.Tuple | ast.List) else []
    starred = any(isinstance(item, ast.Starred) for item in (*names, *values))
    if names and len(names) == len(values) and not starred:
        yield from zip(names, values, strict=True)
    else:
        yield target, value


def _named(node: ast.AST, target: ast.expr, value: ast.expr, added: bool) -> Iterator[tuple[str, Binding]]:
    for item in ast.walk(target):
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store):
            yield item.id, Binding(node, value, whole=not added, counts=added)
        elif isinstance(item, ast.Attribute | ast.Subscript) and isinstance(item.ctx, ast.Store):
            root = base(item)
            if root is not None:
                yield root.id, Binding(node, value, whole=False)
                if isinstance(item, ast.Subscript):
                    yield root.id, Binding(node, item.slice, whole=False)


def _changed(call: ast.Call) -> Iterator[tuple[str, Binding]]:
    """What a call may change: what its method belongs to, and what it is given to fill."""
    root = base(call.func) if isinstance(call.func, ast.Attribute) else None
    asks = isinstance(call.func, ast.Attribute) and call.func.attr in _ASKS
    if root is not None and not asks and (call.args or call.keywords):
        yield root.id, Binding(call, call, whole=False)
    given = [*call.args, *(item.value for item in call.keywords)]
    rows = [each for item in given if isinstance(item, ast.Tuple | ast.List) for each in item.elts]
    for item in (*call.args, *rows):
        if isinstance(item, ast.Name) and (root is None or item.id != root.id):
            yield item.id, Binding(call, call, whole=False, fills=True)


def base(node: ast.expr) -> ast.Name | None:
    """The name at the beginning of a chain of attributes and items."""
    while isinstance(node, ast.Attribute | ast.Subscript):
        node = node.value
    return node if isinstance(node, ast.Name) else None
