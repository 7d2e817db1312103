"""A generated server as a syntax tree with its names resolved, ready for the rules.

The rules over it catch the mistakes that agents make, in the file that a person will read. They are no sandbox:
a malicious author can hide from any static rule, which is why the import under watch and the test calls follow.
"""

import ast
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

from octoform.base.escaping import flattened
from octoform.diagnostics import Diagnostic, Span, error

Function = ast.FunctionDef | ast.AsyncFunctionDef
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
_MAX_LINE_SHOWN = 200
_BELOW, _CHILDREN = "_octoform_below", "_octoform_children"


def walk(node: ast.AST) -> tuple[ast.AST, ...]:
    """A node and every node below it, from the top down; kept with the node, since many rules ask for the same ones."""
    found: tuple[ast.AST, ...] | None = getattr(node, _BELOW, None)
    if found is None:
        queue = [node]
        for item in queue:
            queue.extend(children(item))
        found = tuple(queue)
        setattr(node, _BELOW, found)
    return found


def children(node: ast.AST) -> tuple[ast.AST, ...]:
    """The nodes right below a node, kept with it; whether a name is read or stored is a member of it, and no node."""
    found: tuple[ast.AST, ...] | None = getattr(node, _CHILDREN, None)
    if found is None:
        parts: list[ast.AST] = []  # as `ast.iter_child_nodes` does, in half of the time
        for name in _parts(node._fields):
            value = getattr(node, name, None)
            if isinstance(value, ast.AST):
                parts.append(value)
            elif isinstance(value, list):
                parts += [item for item in value if isinstance(item, ast.AST)]
        found = tuple(parts)
        setattr(node, _CHILDREN, found)
    return found


def choices(node: ast.AST) -> list[ast.expr]:
    """The expressions of which a conditional, an ``or`` or ``and``, or an item of a literal is one; else none."""
    if isinstance(node, ast.IfExp):
        return [node.body, node.orelse]
    if isinstance(node, ast.BoolOp | ast.Dict):
        return node.values
    return node.elts if isinstance(node, ast.Tuple | ast.List) else []


@cache
def _parts(fields: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the fields of a class of nodes that may have nodes."""
    return tuple(name for name in fields if name not in _NO_NODES)


_NO_NODES = frozenset({"ctx", "id", "attr", "arg", "kind", "type_comment", "level", "module", "asname", "conversion"})


@dataclass(frozen=True, eq=False)
class Source:
    """One parsed file, compared by identity.

    ``names`` maps a local alias to the dotted name that it was imported as.
    """

    text: str
    lines: tuple[str, ...]
    tree: ast.Module
    names: Mapping[str, str]
    parents: Mapping[ast.AST, ast.AST]

    def dotted(self, node: ast.AST | None) -> str:
        """``cv2.VideoCapture`` for a name or attribute chain, imports resolved; ``()`` marks a call inside it."""
        found = self._dotted.get(node)
        if found is None:
            found = self._dotted[node] = self._spelled(node)
        return found

    @cached_property
    def _dotted(self) -> dict[ast.AST | None, str]:
        return {}

    def _spelled(self, node: ast.AST | None) -> str:
        if isinstance(node, ast.Name):
            return self.names.get(node.id, node.id)
        if isinstance(node, ast.Attribute):
            return f"{self.dotted(node.value)}.{node.attr}"
        if isinstance(node, ast.Call):
            name, first = self.dotted(node.func), node.args[0] if node.args else None
            if name in ("__import__", "importlib.import_module") and isinstance(first, ast.Constant):
                return str(first.value)
            return f"{name}()"
        return f"{self.dotted(node.value)}[]" if isinstance(node, ast.Subscript) else ""

    @cached_property
    def nodes(self) -> tuple[ast.AST, ...]:
        """Every node, from the top down; walked once for all rules."""
        return walk(self.tree)

    @cached_property
    def by_kind(self) -> Mapping[type[ast.AST], list[Any]]:
        """The nodes of each class, in the same order; a rule that wants dictionaries looks at nothing else."""
        found: defaultdict[type[ast.AST], list[Any]] = defaultdict(list)
        for node in self.nodes:
            found[type(node)].append(node)
        return found

    @cached_property
    def calls(self) -> tuple[tuple[ast.Call, str], ...]:
        """Every call with the dotted name of what is called."""
        return tuple((node, self.dotted(node.func)) for node in self.by_kind[ast.Call])

    @cached_property
    def imports(self) -> tuple[ast.Import | ast.ImportFrom, ...]:
        """Every statement that imports, inside of functions too."""
        return tuple(node for node in self.nodes if isinstance(node, (ast.Import, ast.ImportFrom)))

    @cached_property
    def classes(self) -> tuple[ast.ClassDef, ...]:
        """Every class, nested ones too."""
        return tuple(self.by_kind[ast.ClassDef])

    @cached_property
    def functions(self) -> tuple[Function, ...]:
        """Every function and method, nested ones too."""
        return tuple(node for node in self.nodes if isinstance(node, _FUNCTIONS))

    def owner(self, node: ast.AST) -> Function | None:
        """The innermost function whose body holds ``node``; None at module or class level.

        Decorators and default values belong to the scope around their function: they run with it.
        """
        return self._owners[node]

    @cached_property
    def _owners(self) -> dict[ast.AST, Function | None]:
        """The owner of every node: a parent comes before its children."""
        found: dict[ast.AST, Function | None] = {}
        for node in self.nodes:
            above = self.parents.get(node)
            if isinstance(above, _FUNCTIONS) and node in above.body:
                found[node] = above
            else:
                # Operators are one object for many parents, of which the last counts.
                found[node] = None if above is None else found.get(above)
        return found

    def above(self, node: ast.AST) -> Iterator[tuple[ast.AST, ast.AST]]:
        """(ancestor, its child on the way down) up to the innermost function around ``node``."""
        stop = self.owner(node)
        below, above = node, self.parents.get(node)
        while above is not None and above is not stop:
            yield above, below
            below, above = above, self.parents.get(above)

    def entered_from(self, roots: Iterable[Function]) -> list[Function]:
        """The functions of the file that these can enter, themselves too; of a class that they name, all methods."""
        found: list[Function] = []
        queue = list(roots)
        while queue:
            function = queue.pop()
            if function not in found:
                found.append(function)
                queue += self._entered[function]
        return found

    @cached_property
    def called_by_name(self) -> Mapping[str, Function]:
        """The functions that are no methods, nested ones too, by name; of several with one name, the last."""
        of_classes = {each for item in self.classes for each in item.body}
        return {item.name: item for item in self.functions if item not in of_classes}

    @cached_property
    def top_functions(self) -> Mapping[str, Function]:
        """Those of them that no other one holds."""
        return {name: item for name, item in self.called_by_name.items() if self.owner(item) is None}

    @cached_property
    def generators(self) -> frozenset[ast.AST]:
        """Each node of the file with a `yield` in it, at any depth."""
        found: set[ast.AST] = set()
        for item in (*self.by_kind[ast.Yield], *self.by_kind[ast.YieldFrom]):
            above = self.parents.get(item)
            while above is not None and above not in found:
                found.add(above)
                above = self.parents.get(above)
        return frozenset(found)

    @cached_property
    def _entered(self) -> dict[Function, list[Function]]:
        """The names that each function uses: functions of the file, and the methods of its classes."""
        out = {}
        for function in self.functions:
            inside = walk(function)
            names = {item.id for item in inside if isinstance(item, ast.Name)} - self._own_names.get(function, set())
            methods = {item.attr for item in inside if isinstance(item, ast.Attribute)}
            out[function] = [other for other in self.functions if self._is_named(other, names, methods)]
        return out

    def _is_named(self, function: Function, names: set[str], methods: set[str]) -> bool:
        above = self.parents.get(function)
        if isinstance(above, ast.ClassDef):
            return function.name in methods or above.name in names
        return function.name in names

    @cached_property
    def _own_names(self) -> dict[Function | None, set[str]]:
        """The names that each function binds locally."""
        found: dict[Function | None, set[str]] = {}
        shared: dict[Function | None, set[str]] = {}
        for item in self.nodes:
            if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store):
                found.setdefault(self.owner(item), set()).add(item.id)
            elif isinstance(item, (ast.Global, ast.Nonlocal)):
                shared.setdefault(self.owner(item), set()).update(item.names)
        for function in self.functions:
            given = function.args
            found.setdefault(function, set()).update(
                item.arg for item in (*given.posonlyargs, *given.args, *given.kwonlyargs)
            )
        return {function: names - shared.get(function, set()) for function, names in found.items()}

    def asking(self, function: ast.AST) -> list[ast.Call]:
        """The calls of ``runtime.device`` in a function."""
        calls = (item for item in walk(function) if isinstance(item, ast.Call))
        names = ((call, self.dotted(call.func)) for call in calls)
        return [call for call, name in names if name.startswith("runtime.") and name.endswith(".device")]

    def problem(self, code: str, node: Any, summary: str, hint: str | None = None) -> Diagnostic:
        """An error at a node, with its line."""
        line = node.lineno
        text = self.lines[line - 1] if line <= len(self.lines) else ""
        column = len(text.encode()[: node.col_offset].decode("utf-8", "ignore")) + 1
        end = None
        if node.end_lineno == line:
            end = len(text.encode()[: node.end_col_offset].decode("utf-8", "ignore")) + 1
        shown = flattened(text[:_MAX_LINE_SHOWN])
        return error(code, summary, span=Span(line, column, end), source=shown, hint=hint)


@lru_cache(maxsize=256)
def parameters(
    node: Function | ast.Lambda,
) -> tuple[tuple[str, ...], frozenset[str], tuple[tuple[str, ast.expr], ...], str | None]:
    """(names by place, all names, defaults, the name of the rest) of what a function takes."""
    taken = node.args
    names = [item.arg for item in (*taken.posonlyargs, *taken.args)]
    only = [item.arg for item in taken.kwonlyargs]
    defaults = zip(names[len(names) - len(taken.defaults) :], taken.defaults, strict=True)
    keyword = zip(only, taken.kw_defaults, strict=True)
    usual = tuple((name, item) for name, item in (*defaults, *keyword) if item is not None)
    return tuple(names), frozenset({*names, *only}), usual, taken.vararg.arg if taken.vararg else None


@lru_cache(maxsize=4)
def read_source(text: str) -> Source | Diagnostic:
    """The parsed file, or the reason why it is no Python."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python would print its warnings about the server into our output
            tree = ast.parse(text)
            compile(tree, "server.py", "exec", dont_inherit=True)
    except SyntaxError as problem:
        return _no_python(text, problem)
    except (ValueError, RecursionError, MemoryError) as problem:
        summary = f"the server is no Python that can be compiled: {str(problem) or type(problem).__name__}"
        return error("SERVE-SYNTAX", summary, hint="write plain Python text")
    parents = {child: node for node in walk(tree) for child in children(node)}
    return Source(text, tuple(text.splitlines()), tree, dict(_imported(tree)), parents)


def needed_source(text: str) -> Source:
    """The parsed file for a rule; ValueError for text that `read_source` refuses, which no rule is given."""
    source = read_source(text)
    if isinstance(source, Diagnostic):
        raise ValueError(source.summary)
    return source


def imported_modules(source: Source) -> Iterator[tuple[str, ast.Import | ast.ImportFrom, bool]]:
    """(top-level module, statement, whether it is inside a function); a relative import gives ``.``."""
    for node in source.imports:
        if isinstance(node, ast.Import):
            for item in node.names:
                yield item.name.partition(".")[0], node, source.owner(node) is not None
        else:
            top = "." if node.level else (node.module or "").partition(".")[0]
            yield top, node, source.owner(node) is not None


def _imported(tree: ast.Module) -> Iterator[tuple[str, str]]:
    for node in walk(tree):
        if isinstance(node, ast.Import):
            for item in node.names:
                if item.asname:
                    yield item.asname, item.name
                else:
                    yield item.name.partition(".")[0], item.name.partition(".")[0]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for item in node.names:
                yield item.asname or item.name, f"{node.module}.{item.name}"


def _no_python(text: str, problem: SyntaxError) -> Diagnostic:
    line = problem.lineno or 1
    lines = text.splitlines()
    shown = flattened(lines[line - 1][:_MAX_LINE_SHOWN]) if 0 < line <= len(lines) else None
    return error(
        "SERVE-SYNTAX",
        f"the server does not compile: {problem.msg}",
        span=Span(line, max(problem.offset or 1, 1)),
        source=shown,
        hint="write one complete Python file; no code fences around it",
    )
