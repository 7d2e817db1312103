"""Rules for SERVE about what a tool returns: it comes from the device that was asked for, now.

A server whose tools return constants satisfies every schema, and so does one that answers for another device or puts
a number in place of a reading that failed. Each of them was written by an agent and reported to a person that all was
well.
"""

import ast
from collections.abc import Iterator
from functools import lru_cache

from octoform.base.escaping import display, listed
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve.tool_rules import served_tools, tool_functions
from octoform.contracts.server_code.flow import Flow, flow_of
from octoform.contracts.server_code.origins import Origin
from octoform.contracts.server_code.places import constants, literal_places
from octoform.contracts.server_code.server_source import Function, Source, children, needed_source, walk
from octoform.diagnostics import Diagnostic
from octoform.patterns import regex

_ELSEWHERE = regex(
    r"subprocess\.\w+|asyncio\.create_subprocess_exec|asyncio\.open_connection|socket\.(?:socket|create_connection)"
    r"|urllib\.request\.\w+|http\.client\.\w+|(?:requests|httpx|aiohttp)\..+"
    r"|runtime\.(?:channels|counting|evdev|gpio|lines|movement|nmea|registers|units|v4l2|child)\.\w+"
)
"""Ways to reach a device: programs, the network, modules of the runtime that are given it."""
_OF_TIME = regex(r"(?:^|_)(?:time|at|seconds|timestamp)(?:$|_)")
_CHANGES_TEXT = frozenset(
    {
        "replace",
        "removesuffix",
        "removeprefix",
        "strip",
        "lstrip",
        "rstrip",
        "split",
        "rsplit",
        "partition",
        "translate",
    }
)


def not_implemented(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """Every tool does something: none only raises, none has an empty body, and one that reads gives something back."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    hint = "write what the tool does; a tool that cannot be written belongs in left_out of INTERFACE, not here"
    out = []
    for site, tool in served_tools(source, artifacts):
        for function in tool_functions(source, site):
            reads = tool["effect"] == "read"
            if does_nothing(source, function) or (reads and not flow.results(function)):
                summary = f"the tool {display(site.name or '')} is not implemented: a call of it never gives a result"
                out.append(source.problem("SERVE-NOT-IMPLEMENTED", function, summary, hint))
    return out


def device_not_asked(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool finds each of its devices through the runtime, and no other, and its result comes from there."""
    source = needed_source(value)
    flow = flow_of_tools(source, artifacts)
    placed = [source.owner(node) for node, _ in literal_places(source, flow)]
    out = []
    for site, tool in served_tools(source, artifacts):
        roots = tool_functions(source, site)
        used = source.entered_from(roots)
        if any(does_nothing(source, item) or not flow.results(item) for item in roots if tool["effect"] == "read"):
            continue  # that is reported, and is why nothing comes from a device
        asked = [call for function in used for call in source.asking(function)]
        summary = _asks_wrongly(source, flow, asked, tool) or _names_another(source, roots, tool, artifacts)
        summary = summary or _falls_back(source, used, tool)
        if any(owner in used for owner in placed):
            continue
        if summary is None and not _comes_from_there(source, flow, tool, roots, used, found=bool(asked)):
            what = "takes nothing from the device that it asks for" if asked else "never asks for its device"
            summary = f"{what}, so what it returns does not come from there"
        if summary is not None:
            hint = f"call runtime.device({'device' if len(tool['devices']) > 1 else display(tool['devices'][0])}) in it"
            hint += ", and return what is read of it; a tool of presence catches runtime.DeviceAbsent and returns false"
            summary = f"the tool {display(site.name or '')} {summary}"
            out.append(source.problem("SERVE-DEVICE-NOT-ASKED", site.node, summary, hint))
    return out


def flow_of_tools(source: Source, artifacts: Artifacts) -> Flow:
    """The flow of a server with the tools that INTERFACE knows as the ways in."""
    sites = served_tools(source, artifacts)
    return flow_of(source, frozenset(item for site, _ in sites for item in tool_functions(source, site)))


def literal_place(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """No place of a device is written into the server: no path below /dev or /sys, no number of a camera."""
    source = needed_source(value)
    hint = "ask at each call: runtime.device(id).node(class) gives the node, .path(class) the folder of attributes"
    return [
        source.problem("SERVE-LITERAL-PLACE", node, why, hint)
        for node, why in literal_places(source, flow_of_tools(source, artifacts))
    ]


RULES = (
    Rule("SERVE-NOT-IMPLEMENTED", not_implemented),
    Rule("SERVE-DEVICE-NOT-ASKED", device_not_asked),
    Rule("SERVE-LITERAL-PLACE", literal_place),
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
        if any(isinstance(item, ast.Return | ast.Yield | ast.YieldFrom) for item in walk(statement)):
            return False
    return False


def _raises(source: Source, statement: ast.stmt, entered: frozenset[str]) -> bool:
    if isinstance(statement, ast.Raise):
        return True
    if isinstance(statement, ast.Assert):
        return isinstance(statement.test, ast.Constant) and not statement.test.value
    if isinstance(statement, ast.While) and isinstance(statement.test, ast.Constant):
        return bool(statement.test.value) and _always_raises(source, statement.body, entered)
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
        called = list(_surely_called(statement.value))
        names = {source.dotted(call.func) for call in called} - entered
        # A method of an object that is made in the same expression is that of its class.
        names |= {source.dotted(call.func).rpartition(".")[2] for call in called if _is_of_own(source, call)} - entered
        inner = [item for item in source.functions if item.name in names]
        # Of a method that a class below replaces, the one above may only raise.
        ends = {item: _always_raises(source, item.body, entered | {item.name}) for item in inner}
        return any(all(ends[item] for item in inner if item.name == name) for name in {item.name for item in inner})
    return False


def _is_of_own(source: Source, call: ast.Call) -> bool:
    made = call.func.value if isinstance(call.func, ast.Attribute) else None
    own = {item.name for item in source.classes}
    return isinstance(made, ast.Call) and isinstance(made.func, ast.Name) and made.func.id in own


def _surely_called(node: ast.expr) -> Iterator[ast.Call]:
    """The calls of an expression that no condition, loop or lambda can leave out."""
    if isinstance(node, ast.Call):
        yield node
    if not isinstance(node, ast.IfExp | ast.BoolOp | ast.Lambda | ast.ListComp | ast.SetComp | ast.DictComp):
        for item in children(node):
            if isinstance(item, ast.expr) and not isinstance(item, ast.GeneratorExp):
                yield from _surely_called(item)


@lru_cache(maxsize=64)
def does_nothing(source: Source, function: Function) -> bool:
    """Whether a function is empty, or only raises."""
    return _empty(function) or _always_raises(source, function.body, frozenset({function.name}))


def _asks_wrongly(source: Source, flow: Flow, asked: list[ast.Call], tool: JsonObject) -> str | None:
    """Diagnostics for the ids that a tool asks for, as far as they are constants."""
    given = [call.args[0] if call.args else next((k.value for k in call.keywords), None) for call in asked]
    known = [constants(flow, item) for item in given]
    names = {name for each in known for name in each or ()}
    foreign = sorted(names - set(tool["devices"]))
    if foreign:
        return f"asks for {listed(foreign)}, which INTERFACE does not give it"
    missing = sorted(set(tool["devices"]) - names)
    if given and all(known) and missing:
        return f"asks for {listed(sorted(names))} whichever device is named: it never reaches {listed(missing)}"
    for part in (each for item in given if item is not None for each in walk(item)):
        changed = (
            isinstance(part, ast.Call) and isinstance(part.func, ast.Attribute) and part.func.attr in _CHANGES_TEXT
        )
        sliced = isinstance(part, ast.Subscript) and isinstance(part.slice, ast.Slice)
        if (changed or sliced) and flow.of(part) & Origin.DEVICE:
            return "asks for another id than the one that the caller names"
    if asked and any(one != two and (one | two) <= set(tool["devices"]) for one, two in _pairs(source, flow)):
        return "asks for another device than the one that the caller names"
    return None


@lru_cache(maxsize=4)
def _pairs(source: Source, flow: Flow) -> list[tuple[frozenset[str], frozenset[str]]]:
    """The strings that a key and its value can be, of each entry of a table in which both are strings of the file."""
    entries = [each for node in source.by_kind[ast.Dict] for each in zip(node.keys, node.values, strict=True)]
    pairs = [(one, constants(flow, each)) for key, each in entries if (one := constants(flow, key))]
    return [(one, two) for one, two in pairs if two]


def _names_another(source: Source, roots: list[Function], tool: JsonObject, artifacts: Artifacts) -> str | None:
    """Diagnostics for a tool whose own body has the id of a foreign device."""
    known = {device for each in (artifacts.interface or {"tools": []})["tools"] for device in each["devices"]}
    # An id of one word or two may be the name of a class as well.
    known |= {each["id"] for each in (artifacts.probe or {"devices": []})["devices"] if each["id"].count("-") > 1}
    written = {
        node.value
        for node in source.by_kind[ast.Constant]
        if isinstance(node.value, str) and source.owner(node) in roots
    }
    foreign = sorted(written & (known - set(tool["devices"])))
    return f"names {listed(foreign)}, which INTERFACE does not give it" if foreign else None


def _falls_back(source: Source, used: list[Function], tool: JsonObject) -> str | None:
    """Diagnostics for a tool of several devices that falls back to another device when the wanted one fails."""
    if len(tool["devices"]) < 2:
        return None
    for node in source.by_kind[ast.Constant]:
        given = node.value in tool["devices"] and isinstance(source.parents.get(node), ast.Call | ast.keyword)
        handled = given and any(isinstance(above, ast.ExceptHandler) for above, _ in source.above(node))
        if handled and source.owner(node) in used:
            return "goes on with another device where the one that the caller names fails"
    return None


def _comes_from_there(
    source: Source, flow: Flow, tool: JsonObject, roots: list[Function], used: list[Function], *, found: bool
) -> bool:
    """Whether a reading depends on a device, and what acts is given one."""
    if not roots:
        return True
    elsewhere = any(_ELSEWHERE.fullmatch(name) for call, name in source.calls if source.owner(call) in used)
    if tool["effect"] != "read":
        touched = any(flow.of(call) & Origin.READ for call, _ in source.calls if source.owner(call) in used)
        return touched or elsewhere
    if found and _reports_presence(source, flow, tool, used):
        return True
    result = Origin.NONE
    for function in roots:
        result |= flow.returned(function)
    return bool(result & Origin.READ) or (bool(result & Origin.SYSTEM) and (found or elsewhere))


def _reports_presence(source: Source, flow: Flow, tool: JsonObject, used: list[Function]) -> bool:
    """Whether a tool that gives truth values, beside its device and a time, answers false where that is not there."""
    members = (tool.get("output_schema") or {}).get("properties") or {}
    kinds = {str(each.get("type")) for name, each in members.items() if not _OF_TIME.search(name) and name != "device"}
    if kinds != {"boolean"}:
        return False
    for node in (each for each in source.by_kind[ast.Try] if source.owner(each) in used):
        asks = any(flow.of(item) & Origin.FOUND for each in node.body for item in walk(each))
        absent = [each for each in node.handlers if each.type is not None and _of_absence(source, each.type)]
        parts = [item for each in absent for item in walk(each)]
        if asks and any(isinstance(item, ast.Constant) and item.value is False for item in parts):
            return True
    return False


def _of_absence(source: Source, kinds: ast.expr) -> bool:
    return any(source.dotted(item).endswith(("DeviceAbsent", "DeviceFault")) for item in walk(kinds))
