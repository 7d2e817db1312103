"""The origin of a value by the names of a generated server's calls: a device's word, the clock's, chance's."""

import ast
from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeGuard

from octoform.contracts.server_code.server_source import Function, Source, choices, walk
from octoform.patterns import regex


class Origin:
    """The origins of a value; none is a constant of the file.

    ``SYSTEM``: a program, the network or a library gave it without a device as input. ``COUNTED``: how often
    something came about. Plain numbers: a server takes some hundred thousand unions, and those of `enum` look each
    value up.
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


Origins = int
"""A union of them."""

ROUNDS = 12
ELSEWHERE = regex(
    r"subprocess\.\w+|asyncio\.create_subprocess_exec|asyncio\.open_connection|socket\.\w+|urllib\.request\.\w+"
    r"|http\.client\.\w+|(?:requests|httpx|aiohttp|paramiko|telnetlib|ftplib|smtplib|bleak|psutil)\..+"
)
"""Modules that ask something outside of the process: programs and the network."""
CHANCE = regex(
    r"(?:.*\.)?random\..+|secrets\..+|uuid\..+"
    r"|os\.(?:urandom|getpid|getloadavg|times|getrandom|cpu_count)|hash|id"
    r"|resource\..+|platform\..+"
)
CLOCK = regex(
    r"time\.(?:time|monotonic|perf_counter|time_ns|monotonic_ns|process_time)|(?:.*\.)?datetime\.(?:now|utcnow|today)"
    r"|(?:.*\.)?date\.today"
)
PURE = regex(
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
"""Calls that only convert a value, unless it is given the place of a device."""
PLACES = frozenset(
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
"""Methods that describe a path, or make another one of it; whatever else is asked of it reads."""
OPENS = frozenset({"open", "io.open", "os.open", "os.fdopen", "io.FileIO"})
OF_ITSELF = frozenset({"id", "strength", "actuate"})
"""Attributes of a found device that need no access."""
SELF = frozenset({"self", "cls"})
MADE = ("__init__", "__post_init__", "__new__")


def leads_out(statement: ast.AST) -> TypeGuard[ast.If | ast.While]:
    """Whether a test decides if what follows a statement is reached, by more than that there is something."""
    if isinstance(statement, ast.While):
        return not isinstance(statement.test, ast.Constant)
    if not isinstance(statement, ast.If):
        return False
    ways = (ast.Return, ast.Raise, ast.Break, ast.Continue)
    leaves = any(isinstance(item, ways) for part in statement.body for item in walk(part))
    only_raises = all(isinstance(item, ast.Raise) for item in statement.body)
    absent = ast.Is | ast.IsNot
    compares = [item for item in walk(statement.test) if isinstance(item, ast.Compare)]
    tells = any(not isinstance(operator, absent) for item in compares for operator in item.ops)
    return leaves and (tells or not only_raises)


def touches(name: str) -> bool:
    """Calls of converting modules that reach a device all the same."""
    return name.rpartition(".")[2] in ("VideoCapture", "to_thread", "run_in_executor", "FileIO", "fromfile", "imread")


def last(node: ast.AST) -> str:
    """The last part of a name."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""


def inherits(owner: ast.ClassDef, name: str) -> bool:
    """Whether a class names another one as its base."""
    return any(last(item) == name for item in owner.bases)


def is_called(source: Source, node: ast.AST) -> bool:
    """Whether an expression is what a call calls."""
    above = source.parents.get(node)
    return isinstance(above, ast.Call) and above.func is node


def is_registered(source: Source, node: ast.AST) -> bool:
    """Whether a function is where a tool is registered or logged, and not as a value for another one."""
    above = source.parents.get(node)
    if not isinstance(above, ast.Call) or node not in above.args:
        return False
    name = source.dotted(above.func)
    return name.endswith((".tool", ".add_tool")) or (name.startswith("runtime.") and name.endswith(".logged"))


_TESTED, _REPEATED = (ast.If, ast.While), (ast.For, ast.AsyncFor)
_ANNOTATED, _SCOPED = (ast.AnnAssign, ast.AugAssign), (ast.With, ast.AsyncWith)


class Deciding(ABC):
    """The read values that decide whether a statement of a file runs."""

    _source: Source
    _deciding: dict[ast.AST, tuple[tuple[ast.expr, ...], tuple[ast.expr, ...]]]

    @abstractmethod
    def of(self, node: ast.AST | None) -> Origins:
        """The origins of the value of an expression."""

    def control(self, node: ast.AST) -> Origins:
        """The read values that decide whether a statement runs, without the caller's choice."""
        found = Origin.NONE
        for test in self._decided_by(node)[0]:
            found |= self.of(test)
        return (found & (Origin.READ | Origin.SYSTEM | Origin.COUNTED)) | self.past(node)

    def past(self, node: ast.AST) -> Origins:
        """The read values that decided whether a statement is reached: a wait before it, or a way out.

        A way out where nothing was read is none: anyone who makes up a result may still look whether there is one.
        """
        found = Origin.NONE
        for test in self._decided_by(node)[1]:
            found |= self.of(test)
        return found & (Origin.READ | Origin.SYSTEM)

    def _decided_by(self, node: ast.AST) -> tuple[tuple[ast.expr, ...], tuple[ast.expr, ...]]:
        """The tests around a node, and those of the ways out before it; they are where they are in every round."""
        if node not in self._deciding:
            self._deciding[node] = tuple(self._around(node)), tuple(self._ways_out(node))
        return self._deciding[node]

    def _around(self, node: ast.AST) -> Iterator[ast.expr]:
        for above, below in self._source.above(node):
            if isinstance(above, _TESTED) and below is not above.test:
                yield above.test
            elif isinstance(above, _REPEATED) and below is not above.iter:
                yield above.iter
            elif isinstance(above, ast.Match) and below is not above.subject:
                yield above.subject

    def _ways_out(self, node: ast.AST) -> Iterator[ast.expr]:
        owner = self._source.owner(node)
        below, above = node, self._source.parents.get(node)
        while above is not None and below is not owner:
            for _, block in ast.iter_fields(above):
                before = block[: block.index(below)] if isinstance(block, list) and below in block else []
                yield from (item.test for item in before if leads_out(item))
            below, above = above, self._source.parents.get(above)


# Where the names of a generated server get their values: every binding, and those that reach one use of a name.
#
# A tool may bind a name, read a device into it and bind it again; what it returns is the last of these. So a binding
# that stands on every way to a use hides the ones before it. What cannot be decided counts as reaching the use.

Place = tuple[int, int]
_Bound = tuple[Function | None, str, "Binding"]
_LOOPS = (ast.For, ast.AsyncFor, ast.While)
_ASKS = frozenset({"get", "index", "count", "format", "join", "split", "startswith", "endswith", "encode", "replace"})
"""Methods that leave what they belong to as it is."""
ADDS = frozenset({"append", "appendleft", "extend", "insert", "add", "update"})
"""Methods that add what they are given to what they belong to."""
_BINDING = (
    *(ast.Assign, ast.NamedExpr, ast.ClassDef, ast.Call, *_ANNOTATED, *_REPEATED, *_SCOPED),
    *(ast.ExceptHandler, ast.MatchAs, ast.MatchStar, ast.MatchMapping),
)
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
        self._reaching: dict[ast.Name, tuple[list[Binding], bool]] = {}
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
        binding = [item for item in source.nodes if isinstance(item, _BINDING)]
        found = [(source.owner(item), name, each) for item in binding for name, each in _bound(item)]
        found += [*self._by_another_name(found)]
        local = {(owner, name) for owner, name, each in found if each.whole} - shared
        for owner, name, each in found:
            own = owner is None or (owner, name) in local or name in self._parameters[owner]
            home = owner if own else self._home(owner, name, local)
            self._of[home][name].append(each)
        for item in binding:
            self._add_attributes(item)

    def _by_another_name(self, found: list[_Bound]) -> Iterator[_Bound]:
        """What is added to an object through a second name of it: ``chosen = a if x else b``, ``add = a.append``."""
        second: dict[tuple[Function | None, str], set[str]] = defaultdict(set)
        for owner, name, each in found:
            if each.whole and isinstance(each.node, ast.Assign | ast.NamedExpr):
                second[owner, name].update(_same(each.value))
        for call, name in self._source.calls:
            owner, root = self._source.owner(call), base(call.func)
            adds = isinstance(call.func, ast.Name) or name.rpartition(".")[2] in ADDS
            for other in second.get((owner, root.id), ()) if adds and root is not None else ():
                yield owner, other, Binding(call, call, whole=False)

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
        if use not in self._reaching:
            self._reaching[use] = self._found_for(use)
        return self._reaching[use]

    def _found_for(self, use: ast.Name) -> tuple[list[Binding], bool]:
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
        while statement is not None and not isinstance(statement, (ast.stmt, ast.match_case)):
            if isinstance(statement, (ast.IfExp, ast.BoolOp, ast.Lambda, ast.comprehension)):
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
        """The values stored in attributes, and the fields of classes."""
        for target, value in _pairs(node):
            for item in walk(target):
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
    elif isinstance(node, _ANNOTATED) and node.value is not None:
        yield node.target, node.value
    elif isinstance(node, _REPEATED):
        yield node.target, node.iter
    elif isinstance(node, ast.NamedExpr):
        yield node.target, node.value
    elif isinstance(node, _SCOPED):
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
    """The pairs of ``a, b = x, y``; what cannot be distinguished stays together."""
    names = target.elts if isinstance(target, ast.Tuple | ast.List) else []
    values = value.elts if isinstance(value, ast.Tuple | ast.List) else []
    starred = any(isinstance(item, ast.Starred) for item in (*names, *values))
    if names and len(names) == len(values) and not starred:
        yield from zip(names, values, strict=True)
    else:
        yield target, value


def _named(node: ast.AST, target: ast.expr, value: ast.expr, added: bool) -> Iterator[tuple[str, Binding]]:
    for item in walk(target):
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store):
            yield item.id, Binding(node, value, whole=not added, counts=added)
        elif isinstance(item, (ast.Attribute, ast.Subscript)) and isinstance(item.ctx, ast.Store):
            root = base(item)
            if root is not None:
                yield root.id, Binding(node, value, whole=False)
                if isinstance(item, ast.Subscript):
                    yield root.id, Binding(node, item.slice, whole=False)


def _changed(call: ast.Call) -> Iterator[tuple[str, Binding]]:
    """The objects that a call may change: its method's, and arguments to be filled."""
    roots = [] if isinstance(call.func, ast.Name | ast.Subscript) else list(_receivers(call.func))
    asks = isinstance(call.func, ast.Attribute) and call.func.attr in _ASKS
    if not asks and (call.args or call.keywords):
        yield from ((name, Binding(call, call, whole=False)) for name in roots)
    given = [*call.args, *(item.value for item in call.keywords)]
    rows = [each for item in given if isinstance(item, ast.Tuple | ast.List) for each in item.elts]
    for item in (*call.args, *rows):
        if isinstance(item, ast.Name) and item.id not in roots:
            yield item.id, Binding(call, call, whole=False, fills=True)


def _receivers(node: ast.expr) -> Iterator[str]:
    """The names of whose object a method may be: an expression may choose, as in ``(a if x else b).append``."""
    root = base(node)
    if root is not None:
        yield root.id
    for item in [node.value] if isinstance(node, ast.Attribute | ast.Subscript) else choices(node):
        yield from _receivers(item) if root is None else ()


def _same(node: ast.AST) -> Iterator[str]:
    """The names of the objects that a value may be, be a part of, or add to."""
    if isinstance(node, ast.Name):
        yield node.id
    elif isinstance(node, ast.Subscript) or (isinstance(node, ast.Attribute) and node.attr in ADDS):
        yield from _same(node.value)
    elif isinstance(node, ast.IfExp | ast.BoolOp):
        for item in choices(node):
            yield from _same(item)


def base(node: ast.expr) -> ast.Name | None:
    """The name at the beginning of a chain of attributes and items."""
    while isinstance(node, (ast.Attribute, ast.Subscript)):
        node = node.value
    return node if isinstance(node, ast.Name) else None
