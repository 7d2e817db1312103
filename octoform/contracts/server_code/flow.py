"""Data flow of a generated server, the origins of each value: a found device, a reading of it, the caller, chance.

Followed through the syntax tree, by way of names, attributes, functions, classes and the tests that decide whether a
statement runs. What cannot be determined counts as read, so that a right server in unusual words is never taken for a
wrong one: only of what certainly does not depend on a device that is stated.
"""

import ast
from collections.abc import Iterable, Iterator
from functools import lru_cache

from octoform.contracts.server_code.origins import (
    CHANCE,
    CLOCK,
    ELSEWHERE,
    MADE,
    OF_ITSELF,
    OPENS,
    PLACES,
    PURE,
    ROUNDS,
    SELF,
    Binding,
    Bindings,
    Deciding,
    Origin,
    Origins,
    arguments,
    base,
    defaults,
    inherits,
    is_called,
    is_registered,
    last,
    touches,
)
from octoform.contracts.server_code.server_source import Function, Source, children, walk

_COMPREHENSIONS = (ast.ListComp, ast.SetComp, ast.GeneratorExp, ast.DictComp)
_MATCHED = (ast.MatchAs, ast.MatchStar, ast.MatchMapping)


@lru_cache(maxsize=4)
def flow_of(source: Source, roots: frozenset[Function]) -> "Flow":
    """The flow of a file whose tools are these functions."""
    return Flow(source, roots)


class Flow(Deciding):
    """The origins of all expressions of a file, found by going over it until nothing new comes to light."""

    def __init__(self, source: Source, roots: frozenset[Function]) -> None:
        self._source, self._roots = source, roots
        self.bindings = Bindings(source)
        self._classes = {item.name: item for item in source.classes}
        self._named: dict[str, list[Function]] = {}
        for function in source.functions:
            self._named.setdefault(function.name, []).append(function)
        self._calls_of: dict[str, list[ast.Call]] = {}
        for call, _ in source.calls:
            self._calls_of.setdefault(last(call.func), []).append(call)
        called = {call.func for call, _ in source.calls}
        decorators = {each for item in source.functions for each in item.decorator_list}
        self._valued = {
            last(item)
            for item in source.nodes
            if isinstance(item, (ast.Name, ast.Attribute))
            and isinstance(item.ctx, ast.Load)
            and item not in called
            and item not in decorators
            and not is_registered(source, item)
        }
        self._known: dict[ast.AST, Origins] = {}
        self._seen: dict[ast.AST, Origins] = {}
        self._going: set[ast.AST] = set()
        self._open: set[ast.AST] = set()
        self._met = 0
        self._deciding = {}
        self._results: dict[Function, list[ast.expr]] = {}
        self._binders: dict[ast.Name, ast.comprehension | ast.Lambda | None] = {}
        targets = [item for one in source.by_kind[ast.comprehension] for item in walk(one.target)]
        self._inner_names = {item.id for item in targets if isinstance(item, ast.Name)}
        self._inner_names |= {item.arg for one in source.by_kind[ast.Lambda] for item in arguments(one)}
        self._settle()

    def of(self, node: ast.AST | None) -> Origins:
        """The origins of the value of an expression."""
        if node is None:
            return Origin.NONE
        seen = self._seen.get(node)
        if seen is not None:
            self._met += node in self._open
            return seen
        if node in self._going:
            self._met += 1
            return self._known.get(node, Origin.NONE)
        self._going.add(node)
        met = self._met
        found = self._origin(node) | self._known.get(node, Origin.NONE)
        self._going.discard(node)
        if self._met != met:
            self._open.add(node)
        self._seen[node] = found
        return found

    def results(self, function: Function) -> list[ast.expr]:
        """The values that a function returns or yields; a plain None is none."""
        if function not in self._results:
            self._results[function] = self._given_back(function)
        return self._results[function]

    def _given_back(self, function: Function) -> list[ast.expr]:
        out = []
        for item in self._inside(function):
            value = item.value if isinstance(item, (ast.Return, ast.Yield, ast.YieldFrom)) else None
            if value is not None and not (isinstance(value, ast.Constant) and value.value is None):
                out.append(value)
        return out

    def is_inner(self, node: ast.Name) -> bool:
        """Whether a comprehension or a lambda around a name binds it."""
        return self._binder(node) is not None

    def plain(self, node: ast.Name) -> list[ast.AST]:
        """The expressions of which one is what a name stands for here; none where that cannot be determined."""
        if self.is_inner(node):
            return []
        reaching, open_ = self.bindings.reaching(node)
        kept = [each for each in reaching if not each.fills]
        if open_ and self.bindings.is_parameter(self.bindings.scope(node, node.id), node.id):
            return []
        sure = all(each.whole and isinstance(each.node, ast.Assign | ast.AnnAssign | ast.NamedExpr) for each in kept)
        return [each.value for each in kept] if sure else []

    def returned(self, function: Function) -> Origins:
        """The origins of the results of a function."""
        found = Origin.NONE
        for value in self.results(function):
            found |= self.of(value) | self.control(value)
        return found

    def _inside(self, function: Function) -> Iterator[ast.AST]:
        return (item for item in walk(function) if self._source.owner(item) is function)

    def _settle(self) -> None:
        """Round by round, until nothing changes; only what depends on itself (`_open`) takes more than one."""
        values = [item for item in self._source.nodes if isinstance(item, ast.expr)]
        for _ in range(ROUNDS):
            for item in values:
                self.of(item)
            changed = self._seen != self._known
            self._known = self._seen
            if not changed:
                break
            values = [item for item in values if item in self._open]
            self._seen = {node: found for node, found in self._known.items() if node not in self._open}
            self._open = set()
        self._seen = self._known

    def _origin(self, node: ast.AST) -> Origins:
        if isinstance(node, ast.Constant):
            inside = isinstance(node.value, str) and node.value.startswith("/proc/")
            return Origin.SYSTEM if inside else Origin.NONE
        if isinstance(node, ast.Name):
            return self._name(node) if isinstance(node.ctx, ast.Load) else Origin.NONE
        if isinstance(node, ast.Attribute):
            return self._attribute(node)
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, ast.Lambda):
            return self.of(node.body)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
            sides = (node.left, node.right)
            nothing = any(isinstance(item, ast.Constant) and item.value == 0 for item in sides)
            return Origin.NONE if nothing else self._any(sides)
        if isinstance(node, _COMPREHENSIONS):
            parts = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
            return self._any([*parts, *(each for one in node.generators for each in (one.iter, *one.ifs))])
        return self._any([item for item in children(node) if isinstance(item, ast.expr)])

    def _any(self, nodes: Iterable[ast.AST | None]) -> Origins:
        found = Origin.NONE
        for item in nodes:
            found |= self.of(item)
        return found

    def _name(self, node: ast.Name) -> Origins:
        inner = self._inner(node)
        if inner is not None:
            return inner
        scope = self.bindings.scope(node, node.id)
        reaching, open_ = self.bindings.reaching(node)
        if node.id in self._source.names and scope is None:
            return Origin.NONE
        found = Origin.NONE
        fixed = scope in self._roots and self.bindings.is_parameter(scope, node.id)
        fixed = fixed or all(isinstance(each.value, ast.Constant) for each in reaching if each.whole)
        for each in reaching:  # a number or a string cannot be filled
            found |= Origin.NONE if each.fills and fixed else self.bound(each)
        if open_ and scope is not None and self.bindings.is_parameter(scope, node.id):
            found |= self._parameter(scope, node.id)
        if scope is None and all(each.fills for each in reaching):
            for function in self._named.get(node.id, ()):
                found |= self.returned(function)
        return found

    def _inner(self, node: ast.Name) -> Origins | None:
        """The origin of a name that a comprehension or a lambda around it binds; None where none does."""
        binder = self._binder(node)
        if isinstance(binder, ast.Lambda):
            return self._any(binder.args.defaults) | self._lambda_given(binder)
        return None if binder is None else self.of(binder.iter)

    def _binder(self, node: ast.Name) -> ast.comprehension | ast.Lambda | None:
        """The bindings of a name inside of an expression; each is the same one in every round."""
        if node.id not in self._inner_names:
            return None
        if node not in self._binders:
            self._binders[node] = self._binder_of(node)
        return self._binders[node]

    def _binder_of(self, node: ast.Name) -> ast.comprehension | ast.Lambda | None:
        for above, _ in self._source.above(node):
            if isinstance(above, _COMPREHENSIONS):
                for one in above.generators:
                    if node.id in {item.id for item in walk(one.target) if isinstance(item, ast.Name)}:
                        return one
            elif isinstance(above, ast.Lambda) and node.id in {item.arg for item in arguments(above)}:
                return above
        return None

    def _lambda_given(self, node: ast.Lambda) -> Origins:
        """A lambda that is handed to a function of the file is given whatever that has."""
        above = self._source.parents.get(node)
        above = self._source.parents.get(above) if isinstance(above, ast.keyword) and above is not None else above
        if isinstance(above, ast.Call) and above.func is not node:
            return Origin.FOUND | Origin.READ if self._functions(above.func) else Origin.NONE
        return Origin.NONE

    def bound(self, binding: Binding) -> Origins:
        """The origins of a name by one of its bindings."""
        value = binding.value
        if isinstance(value, ast.ExceptHandler):
            return Origin.READ
        if isinstance(value, _MATCHED):
            above = self._source.parents.get(value)
            while above is not None and not isinstance(above, ast.Match):
                above = self._source.parents.get(above)
            return self.of(above.subject) if isinstance(above, ast.Match) else Origin.READ
        if value is binding.node and isinstance(value, ast.Call):
            return self._filled(value) if binding.fills else self._given(value) | self.control(value)
        found = self.of(value) | self.control(binding.node)
        return found | self._count(binding) if binding.counts else found

    def _count(self, binding: Binding) -> Origins:
        """How often something came about; where it is tried, how often it went wrong."""
        kinds = (ast.For, ast.AsyncFor, ast.While, ast.Try, ast.ExceptHandler)
        around = [above for above, _ in self._source.above(binding.node) if isinstance(above, kinds)]
        return Origin.COUNTED if around else Origin.NONE

    def _filled(self, call: ast.Call) -> Origins:
        """The origins that a call may fill into its arguments: a reading, where it has a device."""
        name = self._source.dotted(call.func)
        functions = self._functions(call.func)
        for item in (*call.args, *(each.value for each in call.keywords)):
            functions += self._named.get(item.id, []) if isinstance(item, ast.Name) else []
        known = self._given(call) | (self.of(call.func) if isinstance(call.func, ast.Attribute) else Origin.NONE)
        if name.startswith("runtime.") or (not functions and PURE.fullmatch(name)):
            return Origin.NONE
        if known & Origin.FOUND:
            return Origin.READ
        found = Origin.NONE
        for function in functions:
            for each in (one for item in arguments(function) for one in self.bindings.of(function, item.arg)):
                found |= Origin.NONE if each.whole or each.fills else self.bound(each)
        return found

    def _given(self, call: ast.Call) -> Origins:
        return self._any([*call.args, *(item.value for item in call.keywords)])

    def _parameter(self, function: Function, name: str) -> Origins:
        """The callers' arguments for a parameter; an uncalled function may get any."""
        found = Origin.NONE
        if name in SELF:
            return found
        if function in self._roots:
            found |= Origin.DEVICE if name == "device" else Origin.ARGUMENT
        above = self._source.parents.get(function)
        names = {function.name}
        if isinstance(above, ast.ClassDef) and function.name in MADE:
            names = {above.name, *(each.name for each in self._classes.values() if inherits(each, above.name))}
        calls = [call for each in names for call in self._calls_of.get(each, ())]
        for call in calls:
            found |= self._passed(function, call, name)
        wrapped = any(last(getattr(each, "func", each)) in self._named for each in function.decorator_list)
        if wrapped or names & self._valued or (not calls and function not in self._roots):
            found |= Origin.FOUND | Origin.READ
        return found | self._any(defaults(function, name))

    def _passed(self, function: Function, call: ast.Call, name: str) -> Origins:
        """The argument of one call for a parameter."""
        given = [*function.args.posonlyargs, *function.args.args]
        if given and given[0].arg in SELF:
            given = given[1:]
        places = [item.arg for item in given]
        stars = [item.arg for item in (function.args.vararg, function.args.kwarg) if item is not None]
        unsure = any(isinstance(item, ast.Starred) for item in call.args) or any(k.arg is None for k in call.keywords)
        if name in stars or unsure:
            return self._given(call)
        found = self._any(item.value for item in call.keywords if item.arg == name)
        if name in places and places.index(name) < len(call.args):
            found |= self.of(call.args[places.index(name)])
        return found

    def _attribute(self, node: ast.Attribute) -> Origins:
        name = self._source.dotted(node)
        root = base(node)
        if root is not None and root.id in self._source.names and not self._inner_name(root):
            return Origin.NONE if not CHANCE.fullmatch(name) else Origin.CHANCE
        found = self.of(node.value)
        if node.attr in OF_ITSELF:
            found &= ~Origin.FOUND
        for each in self.bindings.attributes.get(node.attr, ()):
            found |= self.of(each.value) | self.control(each.node)
        for owner in self._classes.values():
            found |= self._field(owner, node.attr)
        for function in self._named.get(node.attr, ()):
            if not is_called(self._source, node):
                found |= self.returned(function)
        return found

    def _inner_name(self, root: ast.Name) -> bool:
        return self.bindings.scope(root, root.id) is not None

    def _field(self, owner: ast.ClassDef, name: str) -> Origins:
        """The argument for a field where a class without `__init__` of its own is made."""
        fields = [
            item.target.id
            for item in owner.body
            if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name)
        ]
        if name not in fields:
            return Origin.NONE
        found = Origin.NONE
        for call in self._calls_of.get(owner.name, ()):
            found |= self._any(item.value for item in call.keywords if item.arg in (name, None))
            at = fields.index(name)
            if at < len(call.args):
                found |= self.of(call.args[at])
        return found

    def _functions(self, called: ast.expr) -> list[Function]:
        """The functions of the file that a call may enter."""
        if isinstance(called, ast.Name):
            local = self.bindings.scope(called, called.id)
            return [] if local is not None else [*self._named.get(called.id, ())]
        if isinstance(called, ast.Attribute):
            return [
                item
                for item in self._named.get(called.attr, ())
                if isinstance(self._source.parents.get(item), ast.ClassDef)
            ]
        return []

    def _call(self, call: ast.Call) -> Origins:
        name = self._source.dotted(call.func)
        given = self._given(call)
        if name.startswith("runtime.") and name.endswith(".device"):
            return Origin.FOUND | given
        if isinstance(call.func, ast.Name) and call.func.id in self._classes:
            return given | self._instance(self._classes[call.func.id])
        functions = self._functions(call.func)
        found = Origin.NONE
        for function in functions:
            found |= self.returned(function)
        if functions and (isinstance(call.func, ast.Name) or self._is_own(call.func)):
            return found
        return found | self._foreign(call, name, given)

    def _is_variable(self, node: ast.Name) -> bool:
        return self.bindings.scope(node, node.id) is not None or bool(self.bindings.of(None, node.id))

    def _instance(self, owner: ast.ClassDef) -> Origins:
        """The origins of an object's special methods, which are called without being named."""
        found = Origin.NONE
        for item in owner.body:
            if not isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef) or item.name in MADE:
                continue
            found |= self.returned(item) if item.name.startswith("__") else Origin.NONE
        return found

    def _is_own(self, called: ast.expr) -> bool:
        """Whether a method is certainly one of the file's own classes."""
        value = called.value if isinstance(called, ast.Attribute) else None
        if isinstance(value, ast.Call):
            return isinstance(value.func, ast.Name) and value.func.id in self._classes
        if not isinstance(value, ast.Name):
            return False
        if value.id in SELF or value.id in self._classes:
            return True
        reaching, open_ = self.bindings.reaching(value)
        made = [each for each in reaching if each.whole]
        sure = bool(made) and (
            not open_ or not self.bindings.is_parameter(self.bindings.scope(value, value.id), value.id)
        )
        return sure and all(
            isinstance(each.value, ast.Call)
            and isinstance(each.value.func, ast.Name)
            and each.value.func.id in self._classes
            for each in made
        )

    def _foreign(self, call: ast.Call, name: str, given: Origins) -> Origins:
        root = base(call.func) if isinstance(call.func, ast.Attribute) else None
        module = root is not None and root.id in self._source.names and not self._inner_name(root)
        receiver = Origin.NONE
        if isinstance(call.func, ast.Attribute):
            receiver = Origin.NONE if module else self.of(call.func.value)
        elif not isinstance(call.func, ast.Name) or self._is_variable(call.func):
            receiver = self.of(call.func)
        found = given | receiver
        if CHANCE.fullmatch(name) or CLOCK.fullmatch(name):
            return found | (Origin.CHANCE if CHANCE.fullmatch(name) else Origin.CLOCK)
        asks = name.startswith("runtime.") and "()" not in name and not PURE.fullmatch(name)
        if asks or ELSEWHERE.fullmatch(name):
            return found | (Origin.READ if found & Origin.FOUND else Origin.SYSTEM)
        method = last(call.func)
        by_name = isinstance(call.func, ast.Name) or module
        if by_name and name not in OPENS and PURE.fullmatch(name) and not touches(name):
            return found
        if not by_name and method in PLACES:
            return found
        if found & (Origin.FOUND | Origin.SYSTEM):
            return found | (Origin.READ if found & Origin.FOUND else Origin.SYSTEM)
        return found | Origin.SYSTEM if module and not PURE.fullmatch(name) and name not in OPENS else found
