"""A rewritten server held against the accepted one: only the tools of one device, and what only they use, may differ.

A step that proves an arm has no business in the camera's tool. The two files are compared statement by statement as
syntax trees, so that layout and comments do not count; what a function of another tool uses, or a statement of the
module itself, belongs to everybody and stays as it is.
"""

import ast
import symtable
from collections.abc import Iterable, Iterator, Set
from difflib import SequenceMatcher

from octoform.base.escaping import display, listed
from octoform.contracts.model import JsonObject
from octoform.contracts.rules.serve.code_rules import is_standard
from octoform.contracts.rules.serve.tool_rules import tool_sites
from octoform.contracts.server_code.script_header import declared_names
from octoform.contracts.server_code.server_source import Function, Source, imported_modules, needed_source
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass, replace

# What in the code of one device's tools can change what belongs to the others, without naming it as its own.
#
# A comparison of statements sees what was rewritten; it doesn't see what rewritten code does when it runs. Reading a
# syntax tree can't prove that it does no harm either. So whatever is a way to the names of another function, to modules
# under another name, to registered tools or to another device is found here, and held against the accepted server.

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
    """The names that a statement uses, each with its place: ``shared`` are all's, ``devices`` the ids of others."""
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
    """The name of ``other`` that is set, or the method that changes one of ``names``; empty for none."""
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


CODE = "STEP-REWRITE-BEYOND"
_REACHING = frozenset({"globals", "vars", "setattr", "delattr", "locals"})
"""Functions that change what they are handed, or hand out all that a module has."""
_HINT = "change only the functions of this device's tools, and what nothing else uses; leave the rest as it was"


@dataclass(frozen=True, slots=True, eq=False)
class Unit:
    """One statement of the module: the names that it binds and uses, the tools that it registers, its tree as text."""

    node: ast.stmt
    names: frozenset[str]
    uses: frozenset[str]
    tools: frozenset[str]
    text: str

    @property
    def title(self) -> str:
        """Its name for a person."""
        return listed(sorted(self.names)) if self.names else f"the statement in line {self.node.lineno}"


@dataclass(frozen=True, slots=True)
class Parts:
    """A server in two: what belongs to one device alone (``inside``), and everything else, each in its order."""

    source: Source
    inside: tuple[Unit, ...]
    outside: tuple[Unit, ...]

    @property
    def shared(self) -> frozenset[str]:
        """The names that belong to everybody."""
        return frozenset(name for unit in self.outside for name in unit.names)


def own_tools(interface: JsonObject, device: str) -> frozenset[str]:
    """The tools that serve this device and no other."""
    return frozenset(tool["name"] for tool in interface["tools"] if tool["devices"] == [device])


def others(interface: JsonObject, device: str) -> frozenset[str]:
    """The other devices that have tools."""
    return frozenset(each for tool in interface["tools"] for each in tool["devices"]) - {device}


def beyond(
    accepted: str,
    rewritten: str,
    tools: frozenset[str],
    deploy: JsonObject,
    devices: frozenset[str] = frozenset(),
) -> list[Diagnostic]:
    """The changes of a rewritten server outside of its step's scope; empty when it keeps to ``tools``.

    Both texts compile. ``deploy`` is the accepted DEPLOY artifact: what it installed may be imported. ``devices`` are
    the ids of the other devices, which these tools have no business with.
    """
    old, new = divided(accepted, tools), divided(rewritten, tools)
    return [
        *_touched(old, new),
        *_reaching_out(old, new),
        *_reaching_for(old, new, devices),
        *_imports(old.source, new.source, deploy),
        *_header(accepted, rewritten),
    ]


def divided(text: str, tools: frozenset[str]) -> Parts:
    """The statements of a server, by whether they belong to these tools alone."""
    source = needed_source(text)
    units = tuple(_units(source))
    own = [unit for unit in units if unit.tools and unit.tools <= tools]
    private = [unit for unit in units if unit.names and not unit.tools]
    while True:
        kept = [unit for unit in private if _only_for(unit, units, {*own, *private})]
        if len(kept) == len(private):
            break
        private = kept
    reached = _reached(own, private)
    inside = {*own, *reached}
    return Parts(
        source,
        tuple(unit for unit in units if unit in inside),
        tuple(unit for unit in units if unit not in inside),
    )


def _only_for(unit: Unit, units: Iterable[Unit], allowed: set[Unit]) -> bool:
    """Whether all that uses a unit's names, or binds one of them a second time, is among ``allowed``."""
    return all(other in allowed for other in units if other is not unit and unit.names & (other.uses | other.names))


def _reached(own: Iterable[Unit], private: Iterable[Unit]) -> list[Unit]:
    """The part of ``private`` that ``own`` uses, directly or transitively."""
    wanted = {name for unit in own for name in unit.uses}
    found: list[Unit] = []
    left = list(private)
    while more := [unit for unit in left if unit.names & wanted]:
        found += more
        wanted |= {name for unit in more for name in unit.uses}
        left = [unit for unit in left if unit not in more]
    return found


def _units(source: Source) -> Iterator[Unit]:
    sites = [(site.name or "", site.node.lineno) for site in tool_sites(source)]
    tables = list(symtable.symtable(source.text, "server.py", "exec").get_children())
    for node in source.tree.body:
        first = min([node.lineno, *(item.lineno for item in getattr(node, "decorator_list", ()))])
        lines = range(first, (node.end_lineno or node.lineno) + 1)
        used = set(_loads(node))
        for table in tables:
            if table.get_lineno() in lines:
                used |= _globals(table)
        tools = frozenset(name for name, line in sites if line in lines)
        yield Unit(node, frozenset(_bound(node)), frozenset(used), tools, ast.dump(node))


def _globals(table: symtable.SymbolTable) -> set[str]:
    """The names of the module that a function or class uses or sets, nested ones too."""
    found = {item.get_name() for item in table.get_symbols() if item.is_global()}
    return found.union(*(_globals(child) for child in table.get_children()))


def _loads(node: ast.stmt) -> Iterator[str]:
    """The names that a statement uses when the module is loaded."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        at_load: list[ast.AST] = [*node.decorator_list, node.args, *([node.returns] if node.returns else [])]
    elif isinstance(node, ast.ClassDef):
        at_load = [*node.decorator_list, *node.bases, *node.keywords]
    else:
        at_load = [node]
    for part in at_load:
        for item in ast.walk(part):
            if isinstance(item, ast.Name) and not isinstance(item.ctx, ast.Store):
                yield item.id


def _bound(node: ast.stmt) -> Iterator[str]:
    """The names of the module that a statement binds."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield node.name
        return
    for item in ast.walk(node):
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store):
            yield item.id
        elif isinstance(item, ast.alias):
            yield item.asname or item.name.partition(".")[0]
        elif isinstance(item, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield item.name


def _touched(old: Parts, new: Parts) -> Iterator[Diagnostic]:
    """The differences in the shared statements."""
    own = {unit.text for unit in old.inside}
    # A statement of this device's alone that nothing uses any more is as it was.
    there = [unit for unit in new.outside if unit.text not in own]
    before, after = [unit.text for unit in old.outside], [unit.text for unit in there]
    for what, a, b, c, d in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
        if what == "equal":
            continue
        names = {name for unit in there[c:d] for name in unit.names}
        for unit in there[c:d]:
            known = any(unit.names & other.names for other in old.outside)
            verb = "changes" if known or not unit.names else "adds"
            yield _problem(new.source, unit.node, f"the rewritten server {verb} {unit.title}{_whose(unit, new)}")
        for unit in old.outside[a:b]:
            if not unit.names & names and not (c < d and not unit.names):
                summary = f"the rewritten server no longer has {unit.title}{_whose(unit, old)}"
                yield error(CODE, summary, path="server.py", hint=_HINT)


def _whose(unit: Unit, parts: Parts) -> str:
    """To whom a statement belongs, as far as there is a name for it."""
    if unit.tools:
        return ", the tool of another device" if len(unit.tools) == 1 else ", tools of other devices"
    users = sorted(
        name for other in parts.outside if other is not unit and other.uses & unit.names for name in other.names
    )
    return f", which {listed(users)} uses" if users else ""


def _reaching_out(old: Parts, new: Parts) -> Iterator[Diagnostic]:
    """Statements inside that set what belongs to everybody, other than the accepted ones did."""
    known = {name for name, _ in _sets(old)}
    for name, node in _sets(new):
        if name not in known:
            yield _problem(
                new.source, node, f"the rewritten server sets {display(name)}, which is not this device's alone"
            )


def _reaching_for(old: Parts, new: Parts, devices: frozenset[str]) -> Iterator[Diagnostic]:
    """Ways inside to what belongs to the others, other than the accepted server has."""
    known = {name for name, _ in _reached_by(old, devices)}
    for name, node in _reached_by(new, devices):
        if name not in known:
            summary = (
                f"the rewritten server reaches for {display(name)}, by which it can touch what is not this device's"
            )
            yield _problem(new.source, node, summary)


def _reached_by(parts: Parts, devices: frozenset[str]) -> Iterator[tuple[str, ast.AST]]:
    foreign = _foreign(parts)
    for unit in parts.inside:
        yield from reached(unit.node, parts.shared & unit.uses, devices)
        yield from ((name, unit.node) for name in sorted(foreign & unit.uses))


def _foreign(parts: Parts) -> set[str]:
    """The functions that are tools of others: decorated ones, and those that a statement without a name registers."""
    functions = {unit.node.name for unit in parts.outside if isinstance(unit.node, Function)}
    registering = [unit for unit in parts.outside if unit.tools]
    return {name for unit in registering for name in unit.names or unit.uses & functions}


def _sets(parts: Parts) -> Iterator[tuple[str, ast.AST]]:
    shared = parts.shared
    for unit in parts.inside:
        for item in ast.walk(unit.node):
            if isinstance(item, ast.Global):
                yield from ((name, item) for name in item.names if name in shared)
            elif isinstance(item, ast.Attribute | ast.Subscript) and not isinstance(item.ctx, ast.Load):
                root = _root(item)
                if root in shared & unit.uses:
                    yield root, item
            elif isinstance(item, ast.Name) and item.id in _REACHING and item.id not in parts.shared:
                yield item.id, item


def _root(node: ast.expr) -> str:
    """The name that a chain of attributes, items and calls begins with; empty where it begins with none."""
    while isinstance(node, ast.Attribute | ast.Subscript | ast.Call):
        node = node.func if isinstance(node, ast.Call) else node.value
    return node.id if isinstance(node, ast.Name) else ""


def _imports(old: Source, new: Source, deploy: JsonObject) -> Iterator[Diagnostic]:
    """Modules that nothing on this host provides for the server."""
    failed = {str(item["name"]).casefold() for item in deploy.get("deps_failed", ())}
    provided = {
        str(item["module"]).partition(".")[0]
        for item in deploy["imports"]
        if str(item["provided_by"]).casefold() not in failed
    }
    known = provided | {name for name, _, _ in imported_modules(old)} | {"runtime"}
    for name, node, _ in imported_modules(new):
        if name not in known and not is_standard(name):
            summary = f"the rewritten server imports {display(name)}, which DEPLOY has not installed"
            yield _problem(new, node, summary, f"what is there: {listed(sorted(provided))}")


def _header(accepted: str, rewritten: str) -> Iterator[Diagnostic]:
    before, after = declared_names(accepted), declared_names(rewritten)
    if before != after:
        differ = listed(sorted(before ^ after))
        summary = f"the header of the rewritten server declares other packages than the accepted one: {differ}"
        yield error(CODE, summary, path="server.py", hint="keep the header as it was; DEPLOY has settled the packages")


def _problem(source: Source, node: ast.AST, summary: str, hint: str = _HINT) -> Diagnostic:
    return replace(source.problem(CODE, node, summary, hint), path="server.py")
