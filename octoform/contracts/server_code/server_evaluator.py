"""What the tools of a generated server make of the kernel's attributes, computed from the syntax tree alone.

Nothing of the server is run: a small evaluator follows numbers from an argument into an attribute and from there into a
result. What it cannot compute is unknown, a test of that is taken both ways, and a tool whose writes are not all
computed has no outcome. So a right server in unusual words is never found wrong, and a wrong one only by an example.
"""

import ast
import itertools
import operator
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Protocol, TypeVar

from octoform.contracts.server_code.computed_values import (
    BINARY,
    CLASS,
    OF,
    PLAIN,
    UNARY,
    UNKNOWN,
    DeviceOfRuntime,
    Failed,
    Inner,
    Later,
    Method,
    OpenFile,
    Place,
    Pool,
    Spent,
    Unsure,
    World,
    is_known,
    is_plain,
    is_unknown,
    plainly,
)
from octoform.contracts.server_code.file_names import FileNames
from octoform.contracts.server_code.outer_calls import OuterCalls
from octoform.contracts.server_code.server_source import Function, Source, parameters

_MAX_STEPS, _MAX_DEPTH = 8000, 10
Scope = dict[str, Any]


class _Return(Exception):
    def __init__(self, value: Any) -> None:
        self.value = value


class _Leave(Exception):
    """The end of a loop, or of one turn of it."""


class Evaluator:
    """One call of one tool, along the way that ``choices`` takes through tests of what is unknown."""

    max_turns: int | None = None
    """After how many turns a ``while`` counts as ended by its test; None for the turns that it has."""

    def __init__(
        self, source: Source, world: World, choices: Sequence[bool], harmless: Callable[[ast.Call, str, bool], bool]
    ) -> None:
        self.world, self._source, self._harmless = world, source, harmless
        self._choices, self.taken = list(choices), list[bool]()
        self._left, self._end = world.left, max(world.left[0] - _MAX_STEPS, 0)
        self._depth = 0
        self._module = FileNames(source, lambda node: self.value(node, {}))
        self._outer = OuterCalls(world, self._enter, self._strange)
        self._functions = source.top_functions

    def call(self, function: Function, named: Mapping[str, Any]) -> Any:
        """The result of a function of the file, in plain values."""
        try:
            return self._enter(Inner(function, {}), (), named)
        except (RecursionError, _Leave) as problem:
            raise Unsure from problem

    def run(self, statements: Sequence[ast.stmt], scope: Scope) -> Scope:
        """The names after some statements of the file."""
        try:
            self._block(statements, scope)
        except (RecursionError, _Leave, _Return) as problem:
            raise Unsure from problem
        return scope

    def _enter(self, inner: Inner, given: Sequence[Any], named: Mapping[str, Any]) -> Any:
        node = inner.node
        names, needed, defaults, rest = parameters(node)
        if node in self._source.generators or node.args.kwarg or self._depth >= _MAX_DEPTH:
            raise Unsure
        scope = dict(inner.scope)
        if names[:1] == ("self",) and "self" in scope:
            given = [scope["self"], *given]
        for name, item in defaults:
            scope[name] = self.value(item, {})
        scope.update(zip(names, given, strict=False))
        scope.update(named)
        if rest is not None:
            scope[rest] = tuple(given[len(names) :])
        if not needed <= scope.keys():
            raise Unsure
        self._depth += 1
        try:
            if isinstance(node, ast.Lambda):
                return self.value(node.body, scope)
            self._block(node.body, scope)
        except _Return as back:
            return back.value
        finally:
            self._depth -= 1
        return None

    def _decide(self, test: Any) -> bool:
        """Whether a test holds; one of what is unknown is taken as the choices have it."""
        if not is_unknown(test):
            return bool(test)
        at = len(self.taken)
        self.taken.append(self._choices[at] if at < len(self._choices) else True)
        return self.taken[-1]

    def _block(self, statements: Sequence[ast.stmt], scope: Scope) -> None:
        for item in statements:
            run = _STATEMENTS.get(type(item))
            if run is None:
                raise Unsure
            run(self, item, scope)

    def _expression(self, node: ast.Expr, scope: Scope) -> None:
        self.value(node.value, scope)

    def _nothing(self, _: ast.stmt, __: Scope) -> None:
        """What changes no value."""

    def _assign(self, node: ast.Assign | ast.AnnAssign, scope: Scope) -> None:
        if node.value is not None:
            value = self.value(node.value, scope)
            for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
                self._store(target, value, scope)

    def _store(self, target: ast.expr, value: Any, scope: Scope) -> None:
        if isinstance(target, ast.Name):
            scope[target.id] = value
        elif isinstance(target, (ast.Tuple, ast.List)):
            known = isinstance(value, (list, tuple)) and len(value) == len(target.elts)
            for at, item in enumerate(target.elts):
                self._store(item, value[at] if known else UNKNOWN, scope)
        elif isinstance(target, ast.Subscript):
            record, key = self.value(target.value, scope), self.value(target.slice, scope)
            if not isinstance(record, (dict, list)) or is_unknown(key):
                raise Unsure
            plainly(record.__setitem__, key, value)
        elif isinstance(target, ast.Attribute) and isinstance(record := self.value(target.value, scope), dict):
            record[target.attr] = value
        else:
            raise Unsure

    def _add(self, node: ast.AugAssign, scope: Scope) -> None:
        if not isinstance(node.target, ast.Name):
            raise Unsure
        before = scope.get(node.target.id, UNKNOWN)
        scope[node.target.id] = self._two(type(node.op), before, self.value(node.value, scope))

    def _return(self, node: ast.Return, scope: Scope) -> None:
        raise _Return(self.value(node.value, scope) if node.value is not None else None)

    def _if(self, node: ast.If, scope: Scope) -> None:
        self._block(node.body if self._decide(self.value(node.test, scope)) else node.orelse, scope)

    def _for(self, node: ast.For, scope: Scope) -> None:
        rows = self.value(node.iter, scope)
        if not isinstance(rows, (list, tuple, range, str, dict)):
            rows = [UNKNOWN] if self._decide(UNKNOWN) else []
        for row in list(rows):
            self._store(node.target, row, scope)
            if not self._turn(node.body, scope):
                return
        self._block(node.orelse, scope)

    def _while(self, node: ast.While, scope: Scope) -> None:
        for _ in itertools.count() if self.max_turns is None else range(self.max_turns):
            if not self._decide(self.value(node.test, scope)):
                break
            if not self._turn(node.body, scope):
                return
        self._block(node.orelse, scope)

    def _turn(self, body: Sequence[ast.stmt], scope: Scope) -> bool:
        """Whether a loop goes on after one turn of it."""
        try:
            self._block(body, scope)
        except _Leave as way:
            return not way.args
        return True

    def _with(self, node: ast.With | ast.AsyncWith, scope: Scope) -> None:
        left: list[Inner] = []
        for item in node.items:
            value = self.value(item.context_expr, scope)
            left = [*self._methods(value, "__exit__"), *left]
            for enter in self._methods(value, "__enter__"):
                value = self._enter(enter, (), {})
            if item.optional_vars is not None:
                self._store(item.optional_vars, value, scope)
        try:
            self._block(node.body, scope)
        finally:
            for leave in left:
                self._enter(leave, (None, None, None), {})

    def _methods(self, owner: Any, name: str) -> list[Inner]:
        """The method of an object of the file, bound to it; none where it has none."""
        found = self._module.method(owner.get(CLASS, ""), name) if isinstance(owner, dict) else None
        return [Inner(found[1], {"self": owner, OF: found[0]})] if found is not None else []

    def _try(self, node: ast.Try, scope: Scope) -> None:
        try:
            self._block([*node.body, *node.orelse], scope)
        except Failed as problem:
            raise Unsure from problem
        finally:
            self._block(node.finalbody, scope)

    def _raise(self, node: ast.Raise | ast.Break | ast.Continue, _: Scope) -> None:
        raise Failed if isinstance(node, ast.Raise) else _Leave(*([True] if isinstance(node, ast.Break) else []))

    def _assert(self, node: ast.Assert, scope: Scope) -> None:
        if not self._decide(self.value(node.test, scope)):
            raise Failed

    def _define(self, node: ast.FunctionDef | ast.AsyncFunctionDef, scope: Scope) -> None:
        scope[node.name] = Inner(node, scope)

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """The value of an expression."""
        left = self._left
        left[0] -= 1
        if left[0] < self._end:
            raise Spent if left[0] < 0 else Unsure
        if isinstance(node, ast.Constant):
            return node.value
        if isinstance(node, ast.Name) and node.id in scope:
            return scope[node.id]
        compute = _EXPRESSIONS.get(type(node))
        return UNKNOWN if compute is None else compute(self, node, scope)

    def _name(self, node: ast.Name, _: Scope) -> Any:
        function = self._functions.get(node.id)
        return self._module.value(node.id) if function is None else Inner(function, {})

    def _two(self, kind: type[ast.AST], left: Any, right: Any) -> Any:
        if kind is ast.Div and isinstance(left, Place):
            return Place((*left.key, right)) if isinstance(right, str) else UNKNOWN
        if kind is ast.In or kind is ast.NotIn:
            return self._within(left, right, negated=kind is ast.NotIn)
        if (kind is ast.Is or kind is ast.IsNot) and (left is None or right is None):
            return UNKNOWN if is_unknown(left) or is_unknown(right) else (left is right) is (kind is ast.Is)
        combine = BINARY.get(kind)
        return plainly(combine, left, right) if combine is not None and is_plain(left) and is_plain(right) else UNKNOWN

    def _within(self, left: Any, right: Any, *, negated: bool) -> Any:
        if is_plain(left) and isinstance(right, (list, tuple, set, dict)):
            if any(is_plain(item) and item == left for item in right):
                return not negated
            return negated if all(map(is_plain, right)) else UNKNOWN
        if isinstance(left, str) and isinstance(right, str):
            return (left in right) is not negated
        return UNKNOWN

    def _binary(self, node: ast.BinOp, scope: Scope) -> Any:
        return self._two(type(node.op), self.value(node.left, scope), self.value(node.right, scope))

    def _unary(self, node: ast.UnaryOp, scope: Scope) -> Any:
        value = self.value(node.operand, scope)
        return plainly(UNARY[type(node.op)], value) if is_plain(value) else UNKNOWN

    def _compare(self, node: ast.Compare, scope: Scope) -> Any:
        left, sure = self.value(node.left, scope), True
        for kind, item in zip(node.ops, node.comparators, strict=True):
            right = self.value(item, scope)
            found = self._two(type(kind), left, right)
            if not is_unknown(found) and not found:
                return False
            left, sure = right, sure and not is_unknown(found)
        return True if sure else UNKNOWN

    def _boolean(self, node: ast.BoolOp, scope: Scope) -> Any:
        value: Any = None
        for item in node.values:
            value = self.value(item, scope)
            if self._decide(value) is isinstance(node.op, ast.Or):
                return value
        return value

    def _choice(self, node: ast.IfExp, scope: Scope) -> Any:
        return self.value(node.body if self._decide(self.value(node.test, scope)) else node.orelse, scope)

    def _joined(self, node: ast.JoinedStr, scope: Scope) -> Any:
        out = ""
        for item in node.values:
            value = self.value(item.value if isinstance(item, ast.FormattedValue) else item, scope)
            form = item.format_spec if isinstance(item, ast.FormattedValue) else None
            spec = self.value(form, scope) if form is not None else ""
            if not is_plain(value) or not isinstance(spec, str):
                return UNKNOWN
            out += plainly(format, value, spec)
        return out

    def _rows(self, node: ast.List | ast.Tuple | ast.Set, scope: Scope) -> Any:
        if ast.Starred in map(type, node.elts):
            return UNKNOWN
        rows = [self.value(item, scope) for item in node.elts]
        return tuple(rows) if isinstance(node, ast.Tuple) else rows

    def _record(self, node: ast.Dict, scope: Scope) -> Any:
        found: dict[Any, Any] = {}
        for key, item in zip(node.keys, node.values, strict=True):
            value, name = self.value(item, scope), self.value(key, scope) if key is not None else None
            if key is None and isinstance(value, dict):
                found.update(value)
            elif is_plain(name):
                plainly(found.__setitem__, name, value)
        return found

    def _item(self, node: ast.Subscript, scope: Scope) -> Any:
        value = self.value(node.value, scope)
        if isinstance(node.slice, ast.Slice):
            return UNKNOWN
        key = self.value(node.slice, scope)
        known = isinstance(value, (list, tuple, dict, str)) and is_plain(key)
        return plainly(operator.getitem, value, key) if known else UNKNOWN

    def _attribute(self, node: ast.Attribute, scope: Scope) -> Any:
        owner = self.value(node.value, scope)
        if isinstance(owner, dict):
            if node.attr in owner:
                return owner[node.attr]
            for method in self._methods(owner, node.attr):
                return self._bound(method)
        elif node.attr == "folder" and isinstance(owner, DeviceOfRuntime):
            return Place((owner.name, ""))
        elif node.attr == "name" and isinstance(owner, Place) and len(owner.key) > 2:
            return owner.key[-1]
        return Method(owner, node.attr) if is_known(owner) or isinstance(owner, (Later, Pool)) else UNKNOWN

    def _bound(self, method: Inner) -> Any:
        """A method as its owner has it: a property is its value, a static one has no owner."""
        said = {self._source.dotted(item).rpartition(".")[2] for item in getattr(method.node, "decorator_list", ())}
        if said <= {"property", "cached_property"} and said:
            return self._enter(method, (), {})
        if said - {"staticmethod", "override"}:
            return UNKNOWN
        return Inner(method.node, {}) if "staticmethod" in said else method

    def _awaited(self, node: ast.Await, scope: Scope) -> Any:
        return self.value(node.value, scope)

    def _walrus(self, node: ast.NamedExpr, scope: Scope) -> Any:
        self._store(node.target, value := self.value(node.value, scope), scope)
        return value

    def _listed(self, node: ast.ListComp | ast.GeneratorExp, scope: Scope) -> Any:
        inner = self._rows_of(node, scope)
        return UNKNOWN if inner is None else [self.value(node.elt, each) for each in inner]

    def _tabled(self, node: ast.DictComp, scope: Scope) -> Any:
        inner = self._rows_of(node, scope)
        pairs = [(self.value(node.key, each), self.value(node.value, each)) for each in inner or ()]
        return UNKNOWN if inner is None or not all(is_plain(key) for key, _ in pairs) else plainly(dict, pairs)

    def _rows_of(self, node: ast.ListComp | ast.GeneratorExp | ast.DictComp, scope: Scope) -> list[Scope] | None:
        """The names at each row of a comprehension that its tests keep; None where the rows are unknown."""
        rows = self.value(node.generators[0].iter, scope)
        if len(node.generators) != 1 or not isinstance(rows, (list, tuple, range, str)):
            return None
        out = []
        for row in rows:
            inner = dict(scope)
            self._store(node.generators[0].target, row, inner)
            if all(self._decide(self.value(test, inner)) for test in node.generators[0].ifs):
                out.append(inner)
        return out

    def _lambda(self, node: ast.Lambda, scope: Scope) -> Any:
        return Inner(node, scope)

    def _called(self, node: ast.Call, scope: Scope) -> Any:
        given, named = self._given(node, scope)
        name = self._source.dotted(node.func)
        if name.startswith("runtime.") and "()" not in name:
            return self._outer.of_runtime(node, name.removeprefix("runtime."), given, named)
        known = (name.startswith("super().") and self._above(node.func, scope)) or self.value(node.func, scope)
        if isinstance(known, Inner):
            return self._enter(known, given, named)
        if isinstance(known, Method):
            return self._outer.of_value(node, known, given, named)
        if name == "print" and isinstance(named.get("file"), OpenFile):
            text = " ".join(map(str, given)) if all(map(is_plain, given)) else None
            return self._outer.write(named["file"].place, text, node)
        if name in _PATH_CALLS and given and isinstance(given[0], (Place, OpenFile)):
            return OpenFile(given[0]) if name.endswith("open") and isinstance(given[0], Place) else given[0]
        if name in PLAIN:
            whole = all(map(is_plain, (*given, *named.values())))
            return plainly(PLAIN[name], *given, **named) if whole else UNKNOWN
        return self._made(node, node.func.id if isinstance(node.func, ast.Name) else "", given, named)

    def _given(self, node: ast.Call, scope: Scope) -> tuple[list[Any], dict[str, Any]]:
        """The arguments of a call, by place and by name."""
        given: list[Any] = []
        for item in node.args:
            if isinstance(item, ast.Starred):
                rows = self.value(item.value, scope)
                if not isinstance(rows, (list, tuple)):
                    raise Unsure
                given += rows
            else:
                given.append(self.value(item, scope))
        named: dict[str, Any] = {}
        for word in node.keywords:
            value = self.value(word.value, scope)
            if word.arg is not None:
                named[word.arg] = value
            elif isinstance(value, dict):
                if not all(isinstance(name, str) for name in value):
                    raise Failed
                named |= value
        return given, named

    def _above(self, function: ast.expr, scope: Scope) -> Inner | None:
        """The method of a class above, for one that is called on ``super()``."""
        if not isinstance(function, ast.Attribute) or self._source.dotted(function.value) != "super()":
            return None
        found = self._module.method(scope.get(OF, ""), function.attr, above=True)
        return Inner(found[1], {"self": scope.get("self"), OF: found[0]}) if found is not None else None

    def _made(self, node: ast.Call, name: str, given: list[Any], named: Mapping[str, Any]) -> Any:
        """An object of a class of the file, or the result of what is none of the file's."""
        made: dict[str, Any] = {CLASS: name}
        for begin in self._methods(made, "__init__"):
            self._enter(begin, given, named)
            return made
        fields = self._module.fields(name)
        if fields is None:
            return self._outer.of_system(node, self._source.dotted(node.func), given, named)
        usual = {key: self.value(item, {}) for key, item in fields.items() if item is not None}
        return {**made, **usual, **dict(zip(fields, given, strict=False)), **named}

    def _strange(self, node: ast.Call, *given: Any) -> Any:
        """A call of what is not of the file: harmless, or the end of what is known; it may change what it is given."""
        name = self._source.dotted(node.func)
        changed = any(isinstance(item, (list, dict, set)) for item in given)
        if not self._harmless(node, name, changed):
            raise Unsure
        return UNKNOWN


class Way(Protocol):
    """A call along one way, and the choices that were taken on it."""

    taken: list[bool]


_Way = TypeVar("_Way", bound=Way)


def ways(make: Callable[[list[bool]], _Way], most: int, *, whole: bool = False) -> Iterator[_Way]:
    """An evaluator for each way through a call; the caller makes the call with it before it takes the next one.

    There are at most so many; with ``whole``, Unsure where one is left.
    """
    waiting: list[list[bool]] = [[]]
    for _ in range(most):
        if not waiting:
            return
        choices = waiting.pop()
        evaluator = make(choices)
        yield evaluator
        taken = evaluator.taken
        waiting += [[*taken[:at], False] for at in range(len(choices), len(taken))]
    if whole and waiting:
        raise Unsure


_PATH_CALLS = frozenset({"open", "io.open", "pathlib.Path", "str", "os.fspath"})
_STATEMENTS: dict[type[ast.stmt], Any] = {
    **{ast.Assign: Evaluator._assign, ast.AnnAssign: Evaluator._assign, ast.AugAssign: Evaluator._add},
    **{ast.Return: Evaluator._return, ast.If: Evaluator._if, ast.For: Evaluator._for, ast.While: Evaluator._while},
    **{ast.With: Evaluator._with, ast.Try: Evaluator._try, ast.Raise: Evaluator._raise, ast.Break: Evaluator._raise},
    **{ast.Continue: Evaluator._raise, ast.Assert: Evaluator._assert, ast.FunctionDef: Evaluator._define},
    **{ast.Expr: Evaluator._expression, ast.Pass: Evaluator._nothing, ast.Import: Evaluator._nothing},
    **{ast.ImportFrom: Evaluator._nothing, ast.AsyncWith: Evaluator._with, ast.AsyncFunctionDef: Evaluator._define},
}
_EXPRESSIONS: dict[type[ast.expr], Any] = {
    **{ast.Name: Evaluator._name, ast.BinOp: Evaluator._binary},
    **{ast.UnaryOp: Evaluator._unary, ast.Compare: Evaluator._compare, ast.BoolOp: Evaluator._boolean},
    **{ast.IfExp: Evaluator._choice, ast.JoinedStr: Evaluator._joined, ast.List: Evaluator._rows},
    **{ast.Tuple: Evaluator._rows, ast.Set: Evaluator._rows, ast.Dict: Evaluator._record},
    **{ast.Subscript: Evaluator._item, ast.Attribute: Evaluator._attribute, ast.NamedExpr: Evaluator._walrus},
    **{ast.ListComp: Evaluator._listed, ast.GeneratorExp: Evaluator._listed, ast.Lambda: Evaluator._lambda},
    **{ast.DictComp: Evaluator._tabled, ast.Call: Evaluator._called, ast.Await: Evaluator._awaited},
}
