"""Rules for SERVE about what a tool returns: it comes from the device that was asked for, now.

A server whose tools return constants satisfies every schema, and so does one that answers for another device or puts
a number in place of a reading that failed. Each of them was written by an agent and told a person that all was well.
"""

import ast
import re
from collections.abc import Iterator

from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.serve_tool_rules import served_tools, tool_functions
from octoform.contracts.source import Function, Source, needed_source
from octoform.contracts.text import listed, shown
from octoform.diagnostics import Diagnostic

_ELSEWHERE = re.compile(
    r"subprocess\.\w+|asyncio\.create_subprocess_exec|asyncio\.open_connection|socket\.(?:socket|create_connection)"
    r"|urllib\.request\.\w+|http\.client\.\w+|(?:requests|httpx|aiohttp)\..+"
    r"|runtime\.(?:channels|counting|evdev|gpio|lines|movement|nmea|registers|units|v4l2)\.\w+"
)
"""What reaches a device: programs, the network, modules of the runtime that are given it."""
_FOUND = frozenset({"path", "paths", "node", "nodes", "folder"})
"""What a device that was found is asked for: where it is now."""
_PLACES = re.compile(r"/(?:dev|sys)(?:/.*)?", re.DOTALL)
_NOT_DEVICES = re.compile(r"/dev/(?:null|zero|full|u?random|shm(?:/.*)?|std\w+|fd(?:/.*)?)")
_PATH_TESTS = frozenset(
    {"startswith", "removeprefix", "endswith", "is_relative_to", "relative_to", "match", "fullmatch"}
)
_READERS = re.compile(r"runtime\.(?:read_\w+|gpio\.read|evdev\.axis|free_bytes)")


def not_implemented(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """Every tool does something: none only raises, and none has an empty body."""
    source = needed_source(value)
    hint = "write what the tool does; a tool that cannot be written belongs into left_out of INTERFACE, not here"
    out = []
    for site, _ in served_tools(source, artifacts):
        for function in tool_functions(source, site):
            if _empty(function) or _always_raises(source, function.body, frozenset({function.name})):
                summary = f"the tool {shown(site.name or '')} is not implemented: a call of it never gives a result"
                out.append(source.problem("SERVE-NOT-IMPLEMENTED", function, summary, hint))
    return out


def device_not_asked(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool finds each of its devices through the runtime, and no other."""
    source = needed_source(value)
    out = []
    for site, tool in served_tools(source, artifacts):
        roots = tool_functions(source, site)
        used = source.entered_from(roots)
        if any(_empty(item) or _always_raises(source, item.body, frozenset({item.name})) for item in roots):
            continue
        asked = [call for function in used for call in source.asking(function)]
        summary = _asks_wrongly(asked, tool)
        if any(source.owner(node) in used for node, _ in _literal_places(source)):
            continue  # that is told, and is why nothing is asked for
        if summary is None and not any(_reaches(source, function, found=bool(asked)) for function in used):
            what = "takes nothing from the device that it asks for" if asked else "never asks for its device"
            summary = f"{what}, so what it returns does not come from there"
        if summary is not None:
            hint = f"call runtime.device({'device' if len(tool['devices']) > 1 else shown(tool['devices'][0])}) in it"
            summary = f"the tool {shown(site.name or '')} {summary}"
            out.append(source.problem("SERVE-DEVICE-NOT-ASKED", site.node, summary, hint))
    return out


def literal_place(value: str, _: Artifacts) -> list[Diagnostic]:
    """No place of a device is written into the server: no path below /dev or /sys, no number of a camera."""
    source = needed_source(value)
    hint = "ask at each call: runtime.device(id).node(class) gives the node, .path(class) the folder of attributes"
    return [source.problem("SERVE-LITERAL-PLACE", node, why, hint) for node, why in _literal_places(source)]


def default_reading(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A reading that failed is an error or null, never a number that looks like a reading."""
    source = needed_source(value)
    hint = "let the error pass, raise ToolError with what failed, or return None where output_schema allows null"
    used = {
        function
        for site, _ in served_tools(source, artifacts)
        for function in source.entered_from(tool_functions(source, site))
    }
    out = []
    for node in source.nodes:
        if source.owner(node) in used:
            out += [
                source.problem("SERVE-DEFAULT-READING", place, f"a made-up value stands in for {why}", hint)
                for place, why in _made_up(source, node)
            ]
    return out


RULES = (
    Rule("SERVE-NOT-IMPLEMENTED", not_implemented),
    Rule("SERVE-DEVICE-NOT-ASKED", device_not_asked),
    Rule("SERVE-LITERAL-PLACE", literal_place),
    Rule("SERVE-DEFAULT-READING", default_reading),
)


def _empty(function: Function) -> bool:
    return all(isinstance(item, ast.Pass) or _is_constant(item) for item in function.body)


def _is_constant(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _always_raises(source: Source, body: list[ast.stmt], entered: frozenset[str]) -> bool:
    """Whether a block ends in a ``raise`` whichever way is taken through it, and returns on none."""
    for statement in body:
        if _raises(source, statement, entered):
            return True
        if any(isinstance(item, ast.Return | ast.Yield | ast.YieldFrom) for item in ast.walk(statement)):
            return False
    return False


def _raises(source: Source, statement: ast.stmt, entered: frozenset[str]) -> bool:
    if isinstance(statement, ast.Raise):
        return True
    if isinstance(statement, ast.With | ast.AsyncWith):
        return _always_raises(source, statement.body, entered)
    if isinstance(statement, ast.If):
        branches = (statement.body, statement.orelse)
        return all(_always_raises(source, branch, entered) for branch in branches)
    if isinstance(statement, ast.Try):
        return _always_raises(source, statement.finalbody, entered) or (
            _always_raises(source, statement.body, entered)
            and all(_always_raises(source, item.body, entered) for item in statement.handlers)
        )
    if isinstance(statement, ast.Expr | ast.Return | ast.Assign) and statement.value is not None:
        names = {source.dotted(call.func) for call in _surely_called(statement.value)} - entered
        inner = [item for item in source.functions if item.name in names]
        return any(_always_raises(source, item.body, entered | {item.name}) for item in inner)
    return False


def _surely_called(node: ast.expr) -> Iterator[ast.Call]:
    """The calls of an expression that no condition, loop or lambda can leave out."""
    if isinstance(node, ast.Call):
        yield node
    if not isinstance(node, ast.IfExp | ast.BoolOp | ast.Lambda | ast.ListComp | ast.SetComp | ast.DictComp):
        for item in ast.iter_child_nodes(node):
            if isinstance(item, ast.expr) and not isinstance(item, ast.GeneratorExp):
                yield from _surely_called(item)


def _asks_wrongly(asked: list[ast.Call], tool: JsonObject) -> str | None:
    """What is wrong with the ids that a tool asks for, where they are constants."""
    given = [call.args[0] if call.args else next((k.value for k in call.keywords), None) for call in asked]
    names = {str(item.value) for item in given if isinstance(item, ast.Constant)}
    foreign = sorted(names - set(tool["devices"]))
    if foreign:
        return f"asks for {listed(foreign)}, which INTERFACE does not give it"
    missing = sorted(set(tool["devices"]) - names)
    if given and all(isinstance(item, ast.Constant) for item in given) and missing:
        return f"asks for {listed(sorted(names))} whichever device is named: it never reaches {listed(missing)}"
    return None


def _reaches(source: Source, function: Function, *, found: bool) -> bool:
    """Whether a function asks something of a device; of one that was ``found``, where it is counts too."""
    for item in ast.walk(function):
        if isinstance(item, ast.Call) and _ELSEWHERE.fullmatch(source.dotted(item.func)):
            return True
        if found and isinstance(item, ast.Attribute) and item.attr in _FOUND:
            return True
    return False


def _literal_places(source: Source) -> Iterator[tuple[ast.AST, str]]:
    """Where a place is written down, each with what is wrong with it."""
    for node in source.nodes:
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and _is_place(source, node):
            yield node, f"{shown(node.value)} is where a device was when this was written"
    for call, name in source.calls:
        first = call.args[0] if call.args and name.rpartition(".")[2] == "VideoCapture" else None
        if isinstance(first, ast.Constant) and isinstance(first.value, int):
            yield call, f"camera number {first.value} is whichever camera the kernel found at that place"


def _is_place(source: Source, node: ast.Constant) -> bool:
    if not _PLACES.fullmatch(str(node.value)) or _NOT_DEVICES.fullmatch(str(node.value)):
        return False
    above = source.parents.get(node)
    if isinstance(above, ast.Expr | ast.Compare):  # a docstring, a comparison
        return False
    if isinstance(above, ast.BinOp) and isinstance(above.op, ast.Div) and above.right is node:
        return True
    called = above.func if isinstance(above, ast.Call) else None
    if isinstance(called, ast.Attribute) and called.attr in _PATH_TESTS:
        return False
    return not any(isinstance(item, ast.Raise) for item, _ in source.above(node))


def _made_up(source: Source, node: ast.AST) -> Iterator[tuple[ast.AST, str]]:
    if isinstance(node, ast.Try):
        yield from _after_failure(source, node)
    elif isinstance(node, ast.BoolOp) and isinstance(node.op, ast.Or):
        first, last = node.values[0], node.values[-1]
        reads = isinstance(first, ast.Call) and _READERS.fullmatch(source.dotted(first.func))
        if reads and _is_number(last) and not _is_optional(first):
            yield node, "an attribute that could not be read"
    elif isinstance(node, ast.IfExp):
        absent = _branch_of_none(node.test, node.body, node.orelse)
        if absent is not None and _is_number(absent) and not _is_optional(node.test):
            yield node, "a reading that is None"
    elif isinstance(node, ast.If):
        branch = node.body if _tests_none(node.test) and not _is_optional(node.test) else []
        yield from ((item, "a reading that is None") for item in branch if _gives_number(item))


def _is_optional(node: ast.expr) -> bool:
    """Whether an offset or a scale is read: without one the kernel means 0 and 1 (ABI/testing/sysfs-bus-iio)."""
    names = (item.id for item in ast.walk(node) if isinstance(item, ast.Name))
    texts = (item.value for item in ast.walk(node) if isinstance(item, ast.Constant) and isinstance(item.value, str))
    return any("offset" in text or "scale" in text for text in (*names, *texts))


def _after_failure(source: Source, node: ast.Try) -> Iterator[tuple[ast.AST, str]]:
    read = {target.id for item in node.body for target in _targets(item)}
    for handler in node.handlers:
        ends = any(isinstance(item, ast.Raise | ast.Return | ast.Continue | ast.Break) for item in ast.walk(handler))
        for item in ast.walk(handler):
            returned = isinstance(item, ast.Return) and item.value is not None and _made_of_numbers(item.value)
            assigned = isinstance(item, ast.Assign) and _is_number(item.value) and read & _names(item)
            if returned or assigned:
                yield item, "a reading that failed"
        if not ends and not any(read & _names(item) for item in ast.walk(handler)):
            yield from ((item, "a reading that failed") for item in _before(source, node) if _preset(item, read))


def _before(source: Source, node: ast.Try) -> list[ast.stmt]:
    """The statements that stand before this one in its block."""
    above = source.parents.get(node)
    for _, block in ast.iter_fields(above) if above is not None else ():
        if isinstance(block, list) and node in block:
            return block[: block.index(node)]
    return []


def _preset(statement: ast.stmt, names: set[str]) -> bool:
    return isinstance(statement, ast.Assign) and _is_number(statement.value) and bool(names & _names(statement))


def _targets(statement: ast.stmt) -> Iterator[ast.Name]:
    for item in ast.walk(statement):
        if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store):
            yield item


def _names(node: ast.AST) -> set[str]:
    return {item.id for item in ast.walk(node) if isinstance(item, ast.Name) and isinstance(item.ctx, ast.Store)}


def _branch_of_none(test: ast.expr, body: ast.expr, otherwise: ast.expr) -> ast.expr | None:
    if _tests_none(test):
        return body
    return otherwise if _compares_none(test, ast.IsNot) else None


def _tests_none(test: ast.expr) -> bool:
    return _compares_none(test, ast.Is)


def _compares_none(test: ast.expr, kind: type[ast.cmpop]) -> bool:
    if not isinstance(test, ast.Compare) or not isinstance(test.ops[0], kind):
        return False
    return isinstance(test.comparators[0], ast.Constant) and test.comparators[0].value is None


def _gives_number(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Return | ast.Assign) and statement.value is not None and _is_number(statement.value)
    )


def _is_number(node: ast.expr | None) -> bool:
    plain = node.operand if isinstance(node, ast.UnaryOp) else node
    return isinstance(plain, ast.Constant) and type(plain.value) in (int, float)


def _made_of_numbers(node: ast.expr) -> bool:
    """A number, or a record or list one of whose members is written as a number."""
    if isinstance(node, ast.Call):
        name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
        record = name[:1].isupper() or name == "dict"
        return record and any(_made_of_numbers(item) for item in (*node.args, *(each.value for each in node.keywords)))
    if isinstance(node, ast.Dict):
        return any(_made_of_numbers(item) for item in node.values)
    if isinstance(node, ast.List | ast.Tuple):
        return any(_made_of_numbers(item) for item in node.elts)
    return _is_number(node)
