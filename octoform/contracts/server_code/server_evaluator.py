"""What the tools of a generated server make of the kernel's attributes, computed from the syntax tree alone.

Nothing of the server is run: a small evaluator follows numbers from an argument into an attribute and from there into a
result. What it cannot compute is unknown, a test of that is taken both ways, and a tool whose writes are not all
computed has no outcome. So a right server in unusual words is never found wrong, and a wrong one only by an example.
"""

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from octoform.contracts.server_code.computed_values import (
    BINARY,
    METHODS,
    PLAIN,
    UNARY,
    UNKNOWN,
    DeviceOfRuntime,
    Failed,
    Method,
    OpenFile,
    Place,
    Spent,
    Unknown,
    Unsure,
    World,
    is_plain,
    plainly,
)
from octoform.contracts.server_code.server_source import Function, Source, walk

_MAX_STEPS, _MAX_DEPTH = 8000, 10
_YIELDS = (ast.Yield, ast.YieldFrom)
_CLASS = "\0class"
"""The member of an object that names its class."""
Scope = dict[str, Any]


class _Return(Exception):
    def __init__(self, value: Any) -> None:
        self.value = value


class _Leave(Exception):
    """The end of a loop, or of one turn of it."""


@dataclass(frozen=True, eq=False)
class _Inner:
    """A lambda or a function of the file, with the names around it."""

    node: Function | ast.Lambda
    scope: Scope


class Evaluator:
    """One call of one tool, along the way that ``choices`` takes through tests of what is unknown."""

    def __init__(
        self, source: Source, world: World, choices: Sequence[bool], harmless: Callable[[ast.Call, str], bool]
    ) -> None:
        self._source, self._world, self._harmless = source, world, harmless
        self._choices, self.taken = list(choices), list[bool]()
        self._steps = self._depth = 0
        self._module = _Module(self, source)
        self._functions = {item.name: item for item in source.functions if source.owner(item) is None}

    def call(self, function: Function, named: Mapping[str, Any]) -> Any:
        """The result of a function of the file, in plain values."""
        try:
            return self._enter(_Inner(function, {}), (), named)
        except (RecursionError, _Leave) as problem:
            raise Unsure from problem

    def _enter(self, inner: _Inner, given: Sequence[Any], named: Mapping[str, Any]) -> Any:
        node, taken = inner.node, inner.node.args
        strange = isinstance(node, ast.AsyncFunctionDef) or any(isinstance(item, _YIELDS) for item in walk(node))
        if strange or any((taken.vararg, taken.kwarg, taken.posonlyargs)) or self._depth >= _MAX_DEPTH:
            raise Unsure
        names = [item.arg for item in (*taken.args, *taken.kwonlyargs)]
        given = [inner.scope["self"], *given] if names[:1] == ["self"] and "self" in inner.scope else given
        defaults = [*zip(names[len(taken.args) - len(taken.defaults) : len(taken.args)], taken.defaults, strict=True)]
        keyword = zip((item.arg for item in taken.kwonlyargs), taken.kw_defaults, strict=True)
        scope = {**inner.scope, **{name: self.value(item, {}) for name, item in (*defaults, *keyword) if item}}
        scope |= {**dict(zip(names, given, strict=False)), **named}
        if not scope.keys() >= set(names):
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
        if not _is_unknown(test):
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
        elif isinstance(target, ast.Tuple | ast.List):
            known = isinstance(value, list | tuple) and len(value) == len(target.elts)
            for at, item in enumerate(target.elts):
                self._store(item, value[at] if known else UNKNOWN, scope)
        elif isinstance(target, ast.Subscript):
            record, key = self.value(target.value, scope), self.value(target.slice, scope)
            if not isinstance(record, dict | list) or _is_unknown(key):
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
        if not isinstance(rows, list | tuple | range | str | dict):
            rows = [UNKNOWN] if self._decide(UNKNOWN) else []
        for row in list(rows):
            self._store(node.target, row, scope)
            try:
                self._block(node.body, scope)
            except _Leave as way:
                if way.args:
                    return
        self._block(node.orelse, scope)

    def _while(self, node: ast.While, scope: Scope) -> None:
        while self._decide(self.value(node.test, scope)):
            try:
                self._block(node.body, scope)
            except _Leave as way:
                if way.args:
                    return

    def _with(self, node: ast.With, scope: Scope) -> None:
        for item in node.items:
            value = self.value(item.context_expr, scope)
            if item.optional_vars is not None:
                self._store(item.optional_vars, value, scope)
        self._block(node.body, scope)

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

    def _define(self, node: ast.FunctionDef, scope: Scope) -> None:
        scope[node.name] = _Inner(node, scope)

    def value(self, node: ast.expr, scope: Scope) -> Any:
        """The value of an expression."""
        self._steps, self._world.left[0] = self._steps + 1, self._world.left[0] - 1
        if self._world.left[0] < 0:
            raise Spent
        if self._steps > _MAX_STEPS:
            raise Unsure
        compute = _EXPRESSIONS.get(type(node))
        return UNKNOWN if compute is None else compute(self, node, scope)

    def _name(self, node: ast.Name, scope: Scope) -> Any:
        if node.id in scope:
            return scope[node.id]
        if node.id in self._functions:
            return _Inner(self._functions[node.id], {})
        return self._module.value(node.id)

    def _two(self, kind: type[ast.AST], left: Any, right: Any) -> Any:
        if isinstance(left, Place) and kind is ast.Div:
            return Place((*left.key, right)) if isinstance(right, str) else UNKNOWN
        if kind is ast.In or kind is ast.NotIn:
            return self._within(left, right, negated=kind is ast.NotIn)
        sides = (left, right)
        if kind in (ast.Is, ast.IsNot) and None in sides and not any(map(_is_unknown, sides)):
            return (left is right) is (kind is ast.Is)
        combine = BINARY.get(kind)
        return UNKNOWN if combine is None or not all(map(is_plain, sides)) else plainly(combine, left, right)

    def _within(self, left: Any, right: Any, *, negated: bool) -> Any:
        if is_plain(left) and isinstance(right, list | tuple | set | dict):
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
            if not _is_unknown(found) and not found:
                return False
            left, sure = right, sure and not _is_unknown(found)
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
        if any(isinstance(item, ast.Starred) for item in node.elts):
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
        known = isinstance(value, list | tuple | dict | str) and is_plain(key)
        return plainly(lambda: value[key]) if known else UNKNOWN

    def _attribute(self, node: ast.Attribute, scope: Scope) -> Any:
        owner = self.value(node.value, scope)
        if isinstance(owner, DeviceOfRuntime) and node.attr == "folder":
            return Place((owner.name, ""))
        if isinstance(owner, dict) and node.attr in owner:
            return owner[node.attr]
        if isinstance(owner, dict) and (method := self._module.method(owner.get(_CLASS, ""), node.attr)):
            return _Inner(method, {"self": owner})
        if isinstance(owner, Place) and node.attr == "name" and len(owner.key) > 2:
            return owner.key[-1]
        return Method(owner, node.attr) if _is_known(owner) else UNKNOWN

    def _walrus(self, node: ast.NamedExpr, scope: Scope) -> Any:
        self._store(node.target, value := self.value(node.value, scope), scope)
        return value

    def _listed(self, node: ast.ListComp | ast.GeneratorExp, scope: Scope) -> Any:
        rows = self.value(node.generators[0].iter, scope)
        if len(node.generators) != 1 or not isinstance(rows, list | tuple | range | str):
            return UNKNOWN
        out = []
        for row in rows:
            inner = dict(scope)
            self._store(node.generators[0].target, row, inner)
            if all(self._decide(self.value(test, inner)) for test in node.generators[0].ifs):
                out.append(self.value(node.elt, inner))
        return out

    def _lambda(self, node: ast.Lambda, scope: Scope) -> Any:
        return _Inner(node, scope)

    def _called(self, node: ast.Call, scope: Scope) -> Any:
        if any(isinstance(item, ast.Starred) for item in node.args):
            return self._strange(node)
        given = [self.value(item, scope) for item in node.args]
        named = {item.arg: self.value(item.value, scope) for item in node.keywords if item.arg is not None}
        for item in (each for each in node.keywords if each.arg is None):
            more = self.value(item.value, scope)
            named |= more if isinstance(more, dict) else {}
        name = self._source.dotted(node.func)
        if name.startswith("runtime.") and "()" not in name:
            return self._of_runtime(node, name.removeprefix("runtime."), given, named)
        known = self.value(node.func, scope)
        if isinstance(known, _Inner):
            return self._enter(known, given, named)
        if isinstance(known, Method):
            return self._of_value(node, known, given, named)
        if name == "print" and isinstance(named.get("file"), OpenFile):
            return self._write(
                named["file"].place, " ".join(map(str, given)) if all(map(is_plain, given)) else None, node
            )
        if name in ("open", "io.open", "pathlib.Path", "str", "os.fspath") and given and isinstance(given[0], Place):
            return OpenFile(given[0]) if name.endswith("open") else given[0]
        if name in PLAIN:
            whole = all(map(is_plain, (*given, *named.values())))
            return plainly(PLAIN[name], *given, **named) if whole else UNKNOWN
        called = node.func.id if isinstance(node.func, ast.Name) else ""
        if begin := self._module.method(called, "__init__"):
            made = {_CLASS: called}
            self._enter(_Inner(begin, {"self": made}), given, named)
            return made
        fields = self._module.fields(called)
        return {**dict(zip(fields, given, strict=False)), **named} if fields is not None else self._strange(node)

    def _strange(self, node: ast.Call) -> Any:
        """A call of what is not of the file: harmless, or the end of what is known of a tool that acts."""
        name = self._source.dotted(node.func)
        if not self._harmless(node, name):
            raise Unsure
        return UNKNOWN

    def _of_runtime(self, node: ast.Call, name: str, given: list[Any], named: Mapping[str, Any]) -> Any:
        first = given[0] if given else None
        if name == "device":
            return DeviceOfRuntime(first) if isinstance(first, str) else UNKNOWN
        if name == "bus":
            return first
        if name in ("read_number", "read_integer", "read_text", "read_first") and isinstance(first, Place):
            text = self._world.text(first)
            if _is_unknown(text) or name == "read_text":
                return text
            number = plainly(float, text)
            scale = named.get("scale", given[1] if name == "read_number" and len(given) > 1 else 1.0)
            return plainly(int, number) if name == "read_integer" else self._two(ast.Mult, number, scale)
        if name == "files" and isinstance(first, Place):
            return [Place((*first.key, item.replace("*", "1"))) for item in given[1:] if isinstance(item, str)]
        return self._strange(node)

    def _of_value(self, node: ast.Call, method: Method, given: list[Any], named: Mapping[str, Any]) -> Any:
        owner, name = method.owner, method.name
        first = given[0] if given else None
        if isinstance(owner, DeviceOfRuntime):
            kind = [first] if name in ("path", "paths") and isinstance(first, str) else []
            places = [Place((owner.name, each)) for each in kind]
            return owner if name == "bus" else places if name == "paths" else places[0] if places else UNKNOWN
        if isinstance(owner, Place | OpenFile):
            return self._of_place(node, method, given)
        if name in METHODS and _is_known(owner) and hasattr(owner, name):
            parts = (owner, *given, *named.values())
            if name in ("append", "get", "items", "values", "keys", "copy", "update") or all(map(is_plain, parts)):
                return plainly(getattr(owner, name), *given, **named)
            return UNKNOWN
        return self._strange(node)

    def _of_place(self, node: ast.Call, method: Method, given: list[Any]) -> Any:
        owner, name = method.owner, method.name
        place = owner.place if isinstance(owner, OpenFile) else owner
        if name in ("read_text", "read_bytes", "read", "readline"):
            text = self._world.text(place)
            known = not _is_unknown(text)
            return text if not known else f"{text}\n".encode() if name == "read_bytes" else f"{text}\n"
        if name in ("write_text", "write_bytes", "write"):
            text = (
                given[0].decode("utf-8", "replace")
                if given and isinstance(given[0], bytes)
                else given[0]
                if given
                else None
            )
            return self._write(place, text if isinstance(text, str) else None, node)
        if name in ("joinpath", "with_name") and given and all(isinstance(item, str) for item in given):
            return Place((*(place.key if name == "joinpath" else place.key[:-1]), *given))
        if name == "open":
            return OpenFile(place)
        if name in ("resolve", "absolute"):
            return place
        return self._strange(node)

    def _write(self, place: Place, text: str | None, node: ast.Call) -> None:
        if text is None:
            raise Unsure
        self._world.stored[place.key] = text.strip()
        self._world.written[place.key] = node


class _Module:
    """The names of the file itself, each computed once."""

    def __init__(self, evaluator: Evaluator, source: Source) -> None:
        self._evaluator, self._source, self._known = evaluator, source, dict[str, Any]()
        self._bound: dict[str, list[ast.expr]] = {}
        for item in source.tree.body:
            if isinstance(item, ast.Assign | ast.AnnAssign) and item.value is not None:
                for target in item.targets if isinstance(item, ast.Assign) else [item.target]:
                    self._bound.setdefault(ast.unparse(target), []).append(item.value)

    def value(self, name: str) -> Any:
        """The value of a constant of the file; unknown where it is bound more than once."""
        if name not in self._known:
            self._known[name] = UNKNOWN
            bound = self._bound.get(name, [])
            if len(bound) == 1:
                self._known[name] = self._evaluator.value(bound[0], {})
        return self._known[name]

    def method(self, owner: str, name: str) -> ast.FunctionDef | None:
        """A method of a class of the file that has no base."""
        found = [item.body for item in self._source.classes if item.name == owner and not item.bases]
        methods = [item for body in found for item in body if isinstance(item, ast.FunctionDef) and item.name == name]
        return methods[0] if len(methods) == 1 and not methods[0].decorator_list else None

    def fields(self, name: str) -> list[str] | None:
        """The members of a record that the file defines; None where it defines none of the name."""
        for item in self._source.classes:
            if item.name == name and not any(isinstance(each, ast.FunctionDef) for each in item.body):
                names = [each.target for each in item.body if isinstance(each, ast.AnnAssign)]
                return [each.id for each in names if isinstance(each, ast.Name)]
        made = [self._source.dotted(item) for item in self._bound.get(name, [])]
        return [] if len(made) == 1 and made[0].endswith("TypedDict()") else None


def _is_unknown(value: Any) -> bool:
    return isinstance(value, Unknown | Method | _Inner)


def _is_known(value: Any) -> bool:
    return not _is_unknown(value) and value is not None


_STATEMENTS: dict[type[ast.stmt], Any] = {
    **{ast.Assign: Evaluator._assign, ast.AnnAssign: Evaluator._assign, ast.AugAssign: Evaluator._add},
    **{ast.Return: Evaluator._return, ast.If: Evaluator._if, ast.For: Evaluator._for, ast.While: Evaluator._while},
    **{ast.With: Evaluator._with, ast.Try: Evaluator._try, ast.Raise: Evaluator._raise, ast.Break: Evaluator._raise},
    **{ast.Continue: Evaluator._raise, ast.Assert: Evaluator._assert, ast.FunctionDef: Evaluator._define},
    **{ast.Expr: Evaluator._expression, ast.Pass: Evaluator._nothing, ast.Import: Evaluator._nothing},
    **{ast.ImportFrom: Evaluator._nothing},
}
_EXPRESSIONS: dict[type[ast.expr], Any] = {
    **{ast.Constant: lambda _, node, __: node.value, ast.Name: Evaluator._name, ast.BinOp: Evaluator._binary},
    **{ast.UnaryOp: Evaluator._unary, ast.Compare: Evaluator._compare, ast.BoolOp: Evaluator._boolean},
    **{ast.IfExp: Evaluator._choice, ast.JoinedStr: Evaluator._joined, ast.List: Evaluator._rows},
    **{ast.Tuple: Evaluator._rows, ast.Set: Evaluator._rows, ast.Dict: Evaluator._record},
    **{ast.Subscript: Evaluator._item, ast.Attribute: Evaluator._attribute, ast.NamedExpr: Evaluator._walrus},
    **{ast.ListComp: Evaluator._listed, ast.GeneratorExp: Evaluator._listed, ast.Lambda: Evaluator._lambda},
    **{ast.Call: Evaluator._called},
}
