"""A server that HEAL rewrote, held against the accepted one: only the functions that it names, and none of them weaker.

The rules are those of SERVE and of a rewrite within one device, and stricter ones: a repair fixes a function. It brings
in nothing, opens nothing, promises nothing else, and takes nothing away.
"""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator

from octoform.apply.rewrite.scope import Parts, Unit, beyond, divided, own_tools
from octoform.base.escaping import display, listed
from octoform.contracts.model import JsonObject
from octoform.contracts.rules.heal_rules import bereft
from octoform.contracts.rules.serve.device_rules import opens_anything
from octoform.contracts.rules.serve.tool_rules import tool_sites
from octoform.contracts.server_code.server_source import Function, Source, imported_modules
from octoform.diagnostics import Diagnostic, error
from octoform.records import dataclass, replace

# What protects the hardware in the functions of a tool, and what of it a rewrite has lost.
#
# Limits are enforced outside of the server too; these are the checks, locks, bounds and timeouts of its own code.
# Reading code cannot prove that a rewrite is harmless. It can find what was there and is there no more, or reads
# differently, and a repair that has to change such a thing is a person's to make.

WEAKENED = "HEAL-WEAKENS"
_ORDER = (ast.Lt, ast.LtE, ast.Gt, ast.GtE)
_BOUNDING = frozenset({"min", "max", "clamp", "clip"})
_TIMED = ("timeout", "deadline", "patience", "max", "min", "limit", "ge", "le", "gt", "lt", "maximum", "minimum")
_KEEP_CHECKS = (
    "keep every check, bound, lock, timeout and error as it is; a limit that is in the way is for a person to move"
)


def lost(before: Iterable[ast.stmt], after: Iterable[ast.stmt]) -> list[Diagnostic]:
    """The protection in the statements ``before`` that is missing or fewer in ``after``; and errors newly swallowed."""
    old, new = list(before), list(after)
    had, has = Counter(_protections(old)), Counter(_protections(new))
    missing = sorted((had - has).elements())
    found = []
    if missing:
        summary = f"the rewrite has lost what protects: {listed([display(item) for item in missing])}"
        found.append(error(WEAKENED, summary, path="server.py", hint=_KEEP_CHECKS))
    if _swallowed(new) > _swallowed(old):
        summary = "the rewrite catches an error and does not raise one, which would hide the fault"
        found.append(error(WEAKENED, summary, path="server.py", hint="let the error reach the caller, in one sentence"))
    return found


def _protections(statements: Iterable[ast.stmt]) -> Iterator[str]:
    for node in _walked(statements):
        if isinstance(node, ast.If) and _refuses(node.body):
            yield f"if {ast.unparse(node.test)}: raise"
        elif isinstance(node, ast.Assert):
            yield f"assert {ast.unparse(node.test)}"
        elif isinstance(node, ast.Raise):
            yield f"raise {_kind(node.exc)}"
        elif isinstance(node, ast.Compare) and any(isinstance(item, _ORDER) for item in node.ops):
            yield ast.unparse(node)
        elif isinstance(node, ast.With | ast.AsyncWith):
            yield from (f"with {ast.unparse(item.context_expr)}" for item in node.items)
        elif isinstance(node, ast.Call):
            yield from _bounds(node)


def _bounds(call: ast.Call) -> Iterator[str]:
    """A call that bounds a value, and the numbers that bound what is called."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name in _BOUNDING:
        yield ast.unparse(call)
    for item in call.keywords:
        if item.arg is not None and _is_bound(item.arg) and _number(item.value):
            yield f"{item.arg}={ast.unparse(item.value)}"


def _is_bound(name: str) -> bool:
    return any(part in _TIMED for part in name.lower().split("_"))


def _number(node: ast.expr) -> bool:
    node = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(node, ast.Constant) and isinstance(node.value, int | float)


def _refuses(body: list[ast.stmt]) -> bool:
    return any(isinstance(item, ast.Raise) for item in body)


def _kind(node: ast.expr | None) -> str:
    """The class of what is raised; empty where an error is raised again."""
    return ast.unparse(node.func if isinstance(node, ast.Call) else node) if node is not None else ""


def _swallowed(statements: Iterable[ast.stmt]) -> int:
    """Handlers that raise nothing, and blocks that suppress errors."""
    count = 0
    for node in _walked(statements):
        if isinstance(node, ast.ExceptHandler):
            count += not any(isinstance(item, ast.Raise) for item in _walked(node.body))
        elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] == "suppress":
            count += 1
    return count


def _walked(statements: Iterable[ast.stmt]) -> Iterator[ast.AST]:
    for statement in statements:
        yield from ast.walk(statement)


CODE = "HEAL-BEYOND"
_HINT = "change only the functions that you name, of those that input.json lists; leave everything else as it was"


@dataclass(frozen=True, slots=True)
class Reach:
    """The scope of one repair: these tools, these functions of theirs; ``devices`` are the ids of all others."""

    tools: frozenset[str]
    functions: tuple[str, ...]
    devices: frozenset[str] = frozenset()


def reach_of(accepted: str, interface: JsonObject, tool: str | None, device: str | None) -> Reach:
    """The scope of a repair of a tool, or of a device whose tool is unknown; empty where neither is known.

    ``accepted`` compiles.
    """
    listed_tools = {item["name"]: item for item in interface["tools"]}
    tools = frozenset({tool} & listed_tools.keys()) if tool is not None else frozenset[str]()
    if not tools and device is not None:
        tools = own_tools(interface, device)
    served = {each for name in tools for each in listed_tools[name]["devices"]}
    others = frozenset(each for item in interface["tools"] for each in item["devices"]) - served
    functions = sorted(_functions(divided(accepted, tools).inside)) if tools else []
    return Reach(tools, tuple(functions), others)


def objections(
    accepted: str, rewritten: str, reach: Reach, named: frozenset[str], deploy: JsonObject
) -> list[Diagnostic]:
    """Everything that a rewrite changes and may not; both texts compile. ``named`` are the functions it owns up to."""
    old, new = divided(accepted, reach.tools), divided(rewritten, reach.tools)
    found = [
        replace(item, code=CODE, hint=item.hint if "installed" in item.summary else _HINT)
        for item in beyond(accepted, rewritten, reach.tools, deploy, reach.devices)
    ]
    found += _changed(old, new, reach, named)
    found += _promised(old, new)
    found += _brought_in(old, new)
    if not found:
        found += lost(_nodes(_differing(old, new)), _nodes(_differing(new, old)))
        found += bereft(accepted, rewritten, named)
    return found


def _differing(one: Parts, other: Parts) -> list[Unit]:
    """The statements of ``one`` that ``other`` does not have."""
    known = {unit.text for unit in (*other.inside, *other.outside)}
    return [unit for unit in one.inside if unit.text not in known]


def _nodes(units: list[Unit]) -> list[ast.stmt]:
    return [unit.node for unit in units]


def _changed(old: Parts, new: Parts, reach: Reach, named: frozenset[str]) -> Iterator[Diagnostic]:
    """The differences within the tool: named functions of its own, and new functions that only they use."""
    before = {name for unit in (*old.inside, *old.outside) for name in unit.names}
    gone = _functions(old.inside) - _functions((*new.inside, *new.outside))
    gone |= _registered(old) - _registered(new)
    if gone:
        summary = f"the rewritten server no longer has {listed(sorted(gone))}"
        yield error(CODE, summary, path="server.py", hint="a function is fixed, never removed")
    for unit in _differing(new, old):
        names = _functions([unit])
        if not names:
            yield _problem(new.source, unit, f"the rewritten server changes {unit.title}, which is no function")
        elif names & before and not names <= set(reach.functions):
            yield _problem(new.source, unit, f"the rewritten server changes {unit.title}, which is not this tool's")
        elif names & before and not names <= named:
            yield _problem(new.source, unit, f"the rewritten server changes {unit.title} and does not name it")


def _promised(old: Parts, new: Parts) -> Iterator[Diagnostic]:
    """Parameters, result, description and decorators of the tools' own functions: what INTERFACE promises of them."""
    before, after = _served(old), _served(new)
    for name in sorted(before.keys() & after.keys()):
        if _promise(before[name]) != _promise(after[name]):
            summary = f"the rewritten server changes what {display(name)} takes, returns or declares"
            hint = "parameters, defaults, annotations, description and decorators of a tool stay as they are"
            yield replace(new.source.problem(CODE, after[name], summary, hint), path="server.py")


def _served(parts: Parts) -> dict[str, Function]:
    """The functions of the module that are registered as tools themselves."""
    known = {item.name: item for item in parts.source.tree.body if isinstance(item, Function)}
    used = {
        item.id
        for site in tool_sites(parts.source)
        if not isinstance(site.node, Function)
        for item in ast.walk(site.node)
        if isinstance(item, ast.Name)
    }
    decorated = {site.node.name for site in tool_sites(parts.source) if isinstance(site.node, Function)}
    return {name: node for name, node in known.items() if name in used | decorated}


def _promise(function: Function) -> tuple[str, ...]:
    returns = ast.dump(function.returns) if function.returns is not None else ""
    decorators = "".join(ast.dump(item) for item in function.decorator_list)
    return ast.dump(function.args), returns, decorators, ast.get_docstring(function) or "", type(function).__name__


def _brought_in(old: Parts, new: Parts) -> Iterator[Diagnostic]:
    """Modules and openings that the accepted server does not have: a repair needs nothing new."""
    known = {name for name, _, _ in imported_modules(old.source)}
    for name, node, _ in imported_modules(new.source):
        if name not in known:
            yield _problem(
                new.source, node, f"the rewritten server imports {display(name)}, which the accepted does not"
            )
    opened = {name for call, name in old.source.calls if opens_anything(old.source, call)}
    for call, name in new.source.calls:
        if name not in opened and opens_anything(new.source, call):
            yield _problem(new.source, call, f"the rewritten server opens something new with {display(name)}")


def _registered(parts: Parts) -> frozenset[str]:
    return frozenset(name for unit in parts.inside for name in unit.tools)


def _functions(units: tuple[Unit, ...] | list[Unit]) -> frozenset[str]:
    return frozenset(unit.node.name for unit in units if isinstance(unit.node, Function))


def _problem(source: Source, node: Unit | ast.AST, summary: str) -> Diagnostic:
    place = node.node if isinstance(node, Unit) else node
    return replace(source.problem(CODE, place, summary, _HINT), path="server.py")
