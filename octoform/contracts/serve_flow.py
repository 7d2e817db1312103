"""What a value of a generated server depends on: the device that was found, what was read of it, the caller, chance.

Followed through the syntax tree, by way of names, attributes, functions, classes and the tests that decide whether a
statement runs. What cannot be told counts as read, so that a right server in unusual words is never taken for a wrong
one: only of what certainly does not depend on a device that is said.
"""

import ast
import re
from collections.abc import Collection, Iterable, Iterator
from enum import IntFlag
from functools import lru_cache
from typing import TypeGuard

from octoform.contracts.serve_bindings import Binding, Bindings, arguments, base
from octoform.contracts.source import Function, Source


class Origin(IntFlag):
    """What a value depends on; none is a constant of the file.

    ``SYSTEM``: a program, the network or a library said it without being told of a device. ``COUNTED``: how often
    something came about.
    """

    NONE = 0
    ARGUMENT = 1
    FOUND = 2
    READ = 4
    SYSTEM = 8
    CHANCE = 16
    COUNTED = 32
    DEVICE = 64
    CLOCK = 128


_ROUNDS = 12
_ELSEWHERE = re.compile(
    r"subprocess\.\w+|asyncio\.create_subprocess_exec|asyncio\.open_connection|socket\.\w+|urllib\.request\.\w+"
    r"|http\.client\.\w+|(?:requests|httpx|aiohttp|paramiko|telnetlib|ftplib|smtplib|bleak|psutil)\..+"
)
"""What asks something outside of the process: programs and the network."""
_CHANCE = re.compile(
    r"(?:.*\.)?random\..+|secrets\..+|uuid\..+"
    r"|os\.(?:urandom|getpid|getloadavg|times|getrandom|cpu_count)|hash|id"
    r"|resource\..+|platform\..+"
)
_CLOCK = re.compile(
    r"time\.(?:time|monotonic|perf_counter|time_ns|monotonic_ns|process_time)|(?:.*\.)?datetime\.(?:now|utcnow|today)"
    r"|(?:.*\.)?date\.today"
)
_PURE = re.compile(
    r"(?:str|int|float|complex|bool|bytes|bytearray|memoryview|round|len|min|max|sum|sorted|reversed|list|dict|tuple|set"
    r"|frozenset|abs|repr|ascii|format|enumerate|zip|range|isinstance|issubclass|getattr|hasattr|setattr|next|iter|map"
    r"|filter|any|all|type|divmod|pow|ord|chr|hex|bin|oct|slice|vars|super|print|callable|anext|aiter|cast|object"
    r"|(?:pathlib\.)?(?:Pure)?(?:Posix)?Path"
    r"|(?:os\.path|re|json|math|cmath|struct|statistics|decimal|fractions|collections|itertools|functools|operator"
    r"|string|textwrap|base64|binascii|zlib|hashlib|copy|dataclasses|typing|typing_extensions|enum|types|array|io"
    r"|datetime|calendar|logging|contextlib|numpy|np|PIL|pydantic|fastmcp|mcp|attrs|attr|cv2|fnmatch|shlex|bisect"
    r"|heapq|numbers|unicodedata|warnings|asyncio|threading|queue|concurrent|time|random|inspect|weakref|locale|html"
    r"|colorsys|difflib|pprint|reprlib|zoneinfo|runtime\.sentence|runtime\.bus|runtime\.sysroot)(?:\..+)?|.*Error|.*Fault)"
)
"""What only makes one value of another, unless it is given the place of a device."""
_PLACES = frozenset(
    {"node", "nodes", "path", "paths", "bus", "joinpath", "with_name", "with_suffix", "with_stem", "relative_to"}
    | {
        "resolve",
        "absolute",
        "expanduser",
        "as_posix",
        "format",
        "join",
        "strip",
        "split",
        "rsplit",
        "replace",
        "lower",
    }
    | {
        "upper",
        "partition",
        "rpartition",
        "removeprefix",
        "removesuffix",
        "startswith",
        "endswith",
        "encode",
        "confirm",
    }
    | {
        "is_relative_to",
        "match",
        "append",
        "add",
        "extend",
        "insert",
        "update",
        "setdefault",
        "items",
        "values",
        "keys",
    }
    | {
        "copy",
        "index",
        "count",
        "title",
        "capitalize",
        "casefold",
        "lstrip",
        "rstrip",
        "zfill",
        "push",
        "enter_context",
    }
    | {"acquire", "release", "__enter__", "__exit__", "debug", "info", "warning", "error", "exception", "log"}
)
"""Methods that tell of a place, or make another one of it; whatever else is asked of it reads."""
_OPENS = frozenset({"open", "io.open", "os.open", "os.fdopen", "io.FileIO"})
_OF_ITSELF = frozenset({"id", "strength", "actuate"})
"""What a device that was found knows without being asked."""
_SELF = frozenset({"self", "cls"})
_MADE = ("__init__", "__post_init__", "__new__")


@lru_cache(maxsize=4)
def flow_of(source: Source, roots: frozenset[Function]) -> "Flow":
    """The flow of a file whose tools are these functions."""
    return Flow(source, roots)


class Flow:
    """The origins of all expressions of a file, found by going over it until nothing new comes to light."""

    def __init__(self, source: Source, roots: frozenset[Function]) -> None:
        self._source, self._roots = source, roots
        self.bindings = Bindings(source)
        self._classes = {item.name: item for item in source.nodes if isinstance(item, ast.ClassDef)}
        self._named: dict[str, list[Function]] = {}
        for function in source.functions:
            self._named.setdefault(function.name, []).append(function)
        self._calls_of: dict[str, list[ast.Call]] = {}
        for call, _ in source.calls:
            self._calls_of.setdefault(_last(call.func), []).append(call)
        called = {call.func for call, _ in source.calls}
        decorators = {each for item in source.functions for each in item.decorator_list}
        self._valued = {
            _last(item)
            for item in source.nodes
            if isinstance(item, ast.Name | ast.Attribute)
            and isinstance(item.ctx, ast.Load)
            and item not in called
            and item not in decorators
            and not _is_registered(source, item)
        }
        self._known: dict[ast.AST, Origin] = {}
        self._seen: dict[ast.AST, Origin] = {}
        self._going: set[ast.AST] = set()
        self._settle()

    def of(self, node: ast.AST | None) -> Origin:
        """What the value of an expression depends on."""
        if node is None:
            return Origin.NONE
        if node in self._seen:
            return self._seen[node]
        if node in self._going:
            return self._known.get(node, Origin.NONE)
        self._going.add(node)
        found = self._origin(node) | self._known.get(node, Origin.NONE)
        self._going.discard(node)
        self._seen[node] = found
        return found

    def control(self, node: ast.AST) -> Origin:
        """What decides whether a statement runs, of what was read: not whom the caller named."""
        found = Origin.NONE
        for above, below in self._source.above(node):
            if isinstance(above, ast.If | ast.While) and below is not above.test:
                found |= self.of(above.test)
            elif isinstance(above, ast.For | ast.AsyncFor) and below is not above.iter:
                found |= self.of(above.iter)
            elif isinstance(above, ast.Match) and below is not above.subject:
                found |= self.of(above.subject)
        return (found & (Origin.READ | Origin.SYSTEM | Origin.COUNTED)) | self.past(node)

    def past(self, node: ast.AST) -> Origin:
        """What was read that decided that a statement is reached at all: a wait before it, or a way out.

        A way out where nothing was read is none: whoever makes up a result may still look whether there is one.
        """
        owner, found = self._source.owner(node), Origin.NONE
        below, above = node, self._source.parents.get(node)
        while above is not None and below is not owner:
            for _, block in ast.iter_fields(above):
                before = block[: block.index(below)] if isinstance(block, list) and below in block else []
                for item in before:
                    found |= self.of(item.test) if _leads_out(item) else Origin.NONE
            below, above = above, self._source.parents.get(above)
        return found & (Origin.READ | Origin.SYSTEM)

    def results(self, function: Function) -> list[ast.expr]:
        """The values that a function returns or yields; a plain None is none."""
        out = []
        for item in self._inside(function):
            value = item.value if isinstance(item, ast.Return | ast.Yield | ast.YieldFrom) else None
            if value is not None and not (isinstance(value, ast.Constant) and value.value is None):
                out.append(value)
        return out

    def is_inner(self, node: ast.Name) -> bool:
        """Whether a comprehension or a lambda around a name binds it."""
        return self._inner(node) is not None

    def plain(self, node: ast.Name) -> list[ast.AST]:
        """The expressions of which one is what a name stands for here; none where that cannot be told."""
        if self.is_inner(node):
            return []
        reaching, open_ = self.bindings.reaching(node)
        kept = [each for each in reaching if not each.fills]
        if open_ and self.bindings.is_parameter(self.bindings.scope(node, node.id), node.id):
            return []
        sure = all(each.whole and isinstance(each.node, ast.Assign | ast.AnnAssign | ast.NamedExpr) for each in kept)
        return [each.value for each in kept] if sure else []

    def handed(self, node: ast.Name, used: Collection[Function]) -> list[ast.AST]:
        """What those of these functions that call a function hand it for a name; none where that cannot be told."""
        scope = self.bindings.scope(node, node.id)
        if scope is None or scope in self._roots or scope.name in self._valued or self.is_inner(node):
            return []
        given = [item.arg for item in (*scope.args.posonlyargs, *scope.args.args) if item.arg not in _SELF]
        out: list[ast.AST] = []
        for call in (each for each in self._calls_of.get(scope.name, ()) if self._source.owner(each) in used):
            named = [item.value for item in call.keywords if item.arg == node.id]
            at = given.index(node.id) if node.id in given else len(call.args)
            found = [*named, *call.args[at : at + 1]]
            if any(isinstance(item, ast.Starred) for item in call.args) or not found:
                return []
            out += found
        return out

    def returned(self, function: Function) -> Origin:
        """What the results of a function depend on."""
        found = Origin.NONE
        for value in self.results(function):
            found |= self.of(value) | self.control(value)
        return found

    def _inside(self, function: Function) -> Iterator[ast.AST]:
        return (item for item in ast.walk(function) if self._source.owner(item) is function)

    def _settle(self) -> None:
        values = [item for item in self._source.nodes if isinstance(item, ast.expr)]
        for _ in range(_ROUNDS):
            for item in values:
                self.of(item)
            changed = self._seen != self._known
            self._known, self._seen = self._seen, {}
            if not changed:
                break
        self._seen = self._known

    def _origin(self, node: ast.AST) -> Origin:
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
        if isinstance(node, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
            parts = [node.key, node.value] if isinstance(node, ast.DictComp) else [node.elt]
            return self._any([*parts, *(each for one in node.generators for each in (one.iter, *one.ifs))])
        return self._any(item for item in ast.iter_child_nodes(node) if isinstance(item, ast.expr | ast.FormattedValue))

    def _any(self, nodes: Iterable[ast.AST | None]) -> Origin:
        found = Origin.NONE
        for item in nodes:
            found |= self.of(item)
        return found

    def _name(self, node: ast.Name) -> Origin:
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
        for each in reaching:  # what is a number or a text cannot be filled
            found |= Origin.NONE if each.fills and fixed else self.bound(each)
        if open_ and scope is not None and self.bindings.is_parameter(scope, node.id):
            found |= self._parameter(scope, node.id)
        if scope is None and all(each.fills for each in reaching):
            for function in self._named.get(node.id, ()):
                found |= self.returned(function)
        return found

    def _inner(self, node: ast.Name) -> Origin | None:
        """The origin of a name that a comprehension or a lambda around it binds; None where none does."""
        for above, _ in self._source.above(node):
            if isinstance(above, ast.ListComp | ast.SetComp | ast.GeneratorExp | ast.DictComp):
                for one in above.generators:
                    if node.id in {item.id for item in ast.walk(one.target) if isinstance(item, ast.Name)}:
                        return self.of(one.iter)
            elif isinstance(above, ast.Lambda) and node.id in {item.arg for item in arguments(above)}:
                return self._any(above.args.defaults) | self._lambda_given(above)
        return None

    def _lambda_given(self, node: ast.Lambda) -> Origin:
        """A lambda that is handed to a function of the file is given whatever that has."""
        above = self._source.parents.get(node)
        above = self._source.parents.get(above) if isinstance(above, ast.keyword) and above is not None else above
        if isinstance(above, ast.Call) and above.func is not node:
            return Origin.FOUND | Origin.READ if self._functions(above.func) else Origin.NONE
        return Origin.NONE

    def bound(self, binding: Binding) -> Origin:
        """What flows into a name by one of its bindings."""
        value = binding.value
        if isinstance(value, ast.ExceptHandler):
            return Origin.READ
        if isinstance(value, ast.MatchAs | ast.MatchStar | ast.MatchMapping):
            above = self._source.parents.get(value)
            while above is not None and not isinstance(above, ast.Match):
                above = self._source.parents.get(above)
            return self.of(above.subject) if isinstance(above, ast.Match) else Origin.READ
        if value is binding.node and isinstance(value, ast.Call):
            return self._filled(value) if binding.fills else self._given(value) | self.control(value)
        found = self.of(value) | self.control(binding.node)
        return found | self._count(binding) if binding.counts else found

    def _count(self, binding: Binding) -> Origin:
        """How often something came about; where it is tried, how often it went wrong."""
        kinds = (ast.For, ast.AsyncFor, ast.While, ast.Try, ast.ExceptHandler)
        around = [above for above, _ in self._source.above(binding.node) if isinstance(above, kinds)]
        return Origin.COUNTED if around else Origin.NONE

    def _filled(self, call: ast.Call) -> Origin:
        """What a call may bring into what it is given: what it was told, where it knows of a device."""
        name = self._source.dotted(call.func)
        functions = self._functions(call.func)
        for item in (*call.args, *(each.value for each in call.keywords)):
            functions += self._named.get(item.id, []) if isinstance(item, ast.Name) else []
        known = self._given(call) | (self.of(call.func) if isinstance(call.func, ast.Attribute) else Origin.NONE)
        if name.startswith("runtime.") or (not functions and _PURE.fullmatch(name)):
            return Origin.NONE
        if known & Origin.FOUND:
            return Origin.READ
        found = Origin.NONE
        for function in functions:
            for each in (one for item in arguments(function) for one in self.bindings.of(function, item.arg)):
                found |= Origin.NONE if each.whole or each.fills else self.bound(each)
        return found

    def _given(self, call: ast.Call) -> Origin:
        return self._any([*call.args, *(item.value for item in call.keywords)])

    def _parameter(self, function: Function, name: str) -> Origin:
        """What callers give for a parameter; what nobody here calls may be given anything."""
        if name in _SELF:
            return Origin.NONE
        found = Origin.NONE
        if function in self._roots:
            found |= Origin.DEVICE if name == "device" else Origin.ARGUMENT
        above = self._source.parents.get(function)
        names = {function.name}
        if isinstance(above, ast.ClassDef) and function.name in _MADE:
            names = {above.name, *(each.name for each in self._classes.values() if _inherits(each, above.name))}
        calls = [call for each in names for call in self._calls_of.get(each, ())]
        for call in calls:
            found |= self._passed(function, call, name)
        if names & self._valued or (not calls and function not in self._roots):
            found |= Origin.FOUND | Origin.READ
        return found | self._any(self._default(function, name))

    def _default(self, function: Function, name: str) -> Iterator[ast.expr | None]:
        given = [*function.args.posonlyargs, *function.args.args]
        defaults = function.args.defaults
        for item, value in zip(given[len(given) - len(defaults) :], defaults, strict=True):
            if item.arg == name:
                yield value
        for item, default in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True):
            if item.arg == name:
                yield default

    def _passed(self, function: Function, call: ast.Call, name: str) -> Origin:
        """What one call gives for a parameter."""
        given = [*function.args.posonlyargs, *function.args.args]
        if given and given[0].arg in _SELF:
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

    def _attribute(self, node: ast.Attribute) -> Origin:
        name = self._source.dotted(node)
        root = base(node)
        if root is not None and root.id in self._source.names and not self._inner_name(root):
            return Origin.NONE if not _CHANCE.fullmatch(name) else Origin.CHANCE
        found = self.of(node.value)
        if node.attr in _OF_ITSELF:
            found &= ~Origin.FOUND
        for each in self.bindings.attributes.get(node.attr, ()):
            found |= self.of(each.value) | self.control(each.node)
        for owner in self._classes.values():
            found |= self._field(owner, node.attr)
        for function in self._named.get(node.attr, ()):
            if not self._is_called(node):
                found |= self.returned(function)
        return found

    def _inner_name(self, root: ast.Name) -> bool:
        return self.bindings.scope(root, root.id) is not None

    def _is_called(self, node: ast.AST) -> bool:
        above = self._source.parents.get(node)
        return isinstance(above, ast.Call) and above.func is node

    def _field(self, owner: ast.ClassDef, name: str) -> Origin:
        """What is given for a field where a class without `__init__` of its own is made."""
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

    def _call(self, call: ast.Call) -> Origin:
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

    def _instance(self, owner: ast.ClassDef) -> Origin:
        """What using an object of a class may give without naming a method."""
        found = Origin.NONE
        for item in owner.body:
            if not isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef) or item.name in _MADE:
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
        if value.id in _SELF or value.id in self._classes:
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

    def _foreign(self, call: ast.Call, name: str, given: Origin) -> Origin:
        root = base(call.func) if isinstance(call.func, ast.Attribute) else None
        module = root is not None and root.id in self._source.names and not self._inner_name(root)
        receiver = Origin.NONE
        if isinstance(call.func, ast.Attribute):
            receiver = Origin.NONE if module else self.of(call.func.value)
        elif not isinstance(call.func, ast.Name) or self._is_variable(call.func):
            receiver = self.of(call.func)
        found = given | receiver
        if _CHANCE.fullmatch(name) or _CLOCK.fullmatch(name):
            return found | (Origin.CHANCE if _CHANCE.fullmatch(name) else Origin.CLOCK)
        asks = name.startswith("runtime.") and "()" not in name and not _PURE.fullmatch(name)
        if asks or _ELSEWHERE.fullmatch(name):
            return found | (Origin.READ if found & Origin.FOUND else Origin.SYSTEM)
        method = _last(call.func)
        by_name = isinstance(call.func, ast.Name) or module
        if by_name and name not in _OPENS and _PURE.fullmatch(name) and not _touches(name):
            return found
        if not by_name and method in _PLACES:
            return found
        if found & (Origin.FOUND | Origin.SYSTEM):
            return found | (Origin.READ if found & Origin.FOUND else Origin.SYSTEM)
        return found | Origin.SYSTEM if module and not _PURE.fullmatch(name) and name not in _OPENS else found


def _leads_out(statement: ast.AST) -> TypeGuard[ast.If | ast.While]:
    """Whether a test decides if what follows a statement is reached, by more than that there is something."""
    if isinstance(statement, ast.While):
        return not isinstance(statement.test, ast.Constant)
    if not isinstance(statement, ast.If):
        return False
    ways = (ast.Return, ast.Raise, ast.Break, ast.Continue)
    leaves = any(isinstance(item, ways) for part in statement.body for item in ast.walk(part))
    only_raises = all(isinstance(item, ast.Raise) for item in statement.body)
    absent = ast.Is | ast.IsNot
    compares = [item for item in ast.walk(statement.test) if isinstance(item, ast.Compare)]
    tells = any(not isinstance(operator, absent) for item in compares for operator in item.ops)
    return leaves and (tells or not only_raises)


def _touches(name: str) -> bool:
    """What of the modules that only make one value of another reaches a device all the same."""
    return name.rpartition(".")[2] in ("VideoCapture", "to_thread", "run_in_executor", "FileIO", "fromfile", "imread")


def _last(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def _inherits(owner: ast.ClassDef, name: str) -> bool:
    return any(_last(item) == name for item in owner.bases)


def _is_registered(source: Source, node: ast.AST) -> bool:
    """Whether a function stands where a tool is registered or logged, and not as a value for another one."""
    above = source.parents.get(node)
    if not isinstance(above, ast.Call) or node not in above.args:
        return False
    name = source.dotted(above.func)
    return name.endswith((".tool", ".add_tool")) or (name.startswith("runtime.") and name.endswith(".logged"))
