"""Rules for SERVE about its tools: exactly those of INTERFACE, each logged, none a raw pipe, and nothing besides.

The log is what shows later that a tool was really called and what came of it, so a tool without it is as good as
not there. The gate is before tools alone, so whatever else a server could offer would go around it.
"""

import ast
from collections.abc import Collection, Iterator, Mapping
from functools import lru_cache

from octoform.base.escaping import display, escaped, listed
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.movement_words import is_time
from octoform.contracts.name_clues import is_passthrough, tokens
from octoform.contracts.server_code.script_header import interface_errors
from octoform.contracts.server_code.server_source import (
    Function,
    Source,
    imported_modules,
    needed_source,
    parameters,
    walk,
)
from octoform.diagnostics import Diagnostic, Span, as_warning, error
from octoform.patterns import regex
from octoform.records import dataclass

MAX_PROBLEM = 500
_PLAIN_USES = frozenset({"tool", "add_tool", "run", "run_async", "name"})
_PLAIN_OPTIONS = frozenset(
    {"name", "instructions", "version", "website_url", "icons", "on_duplicate", "mask_error_details"}
    | {"dereference_schemas", "strict_input_validation"}
)
"""The allowed arguments of a server: words about it, and how strict it is. All others act on requests."""


@dataclass(frozen=True, slots=True)
class ToolSite:
    """Where a tool is registered; ``name`` is None when it is no constant."""

    name: str | None
    node: ast.expr | ast.stmt
    logged: bool


def no_server(value: str, _: Artifacts) -> list[Diagnostic]:
    """``mcp = FastMCP(...)`` is at module level, where `fastmcp run` finds it."""
    source = needed_source(value)
    if "mcp" in _servers(source):
        return []
    hint = "write mcp = FastMCP(...) at module level"
    return [error("SERVE-NO-SERVER", "the file makes no server called mcp", span=Span(1, 1), hint=hint)]


def tools_differ(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """The registered tools are those of INTERFACE."""
    source = needed_source(value)
    sites = tool_sites(source)
    wanted = {tool["name"] for tool in (artifacts.interface or {"tools": []})["tools"]}
    present = [site.name for site in sites if site.name is not None]
    out = []
    for site in sites:
        if site.name is None:
            summary = "the name of this tool is not constant"
            out.append(source.problem("SERVE-TOOLS-DIFFER", site.node, summary, "write the name as a string"))
        elif site.name not in wanted:
            summary = f"{display(site.name)} is not a tool of INTERFACE"
            hint = "serve exactly the tools of the INTERFACE artifact"
            out.append(source.problem("SERVE-TOOLS-DIFFER", site.node, summary, hint))
        elif present.count(site.name) > 1:
            summary = f"{display(site.name)} is registered more than once"
            out.append(source.problem("SERVE-TOOLS-DIFFER", site.node, summary, "register each tool once"))
    absent = sorted(wanted - set(present))
    if absent:
        summary = f"the server lacks {len(absent)} tools of INTERFACE: {listed(absent)}"
        hint = "register each with @mcp.tool, or @mcp.tool(name=...) with a constant name; where one "
        hint += (
            "cannot be written, report it in the header: [[tool.octoform.interface-errors]] with `tool` and `problem`"
        )
        out.append(error("SERVE-TOOLS-DIFFER", summary, span=Span(1, 1), hint=hint))
    return out


def interface_blamed(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A problem that only INTERFACE can fix is sent to INTERFACE; no server is accepted with it."""
    wanted = {tool["name"] for tool in (artifacts.interface or {"tools": []})["tools"]}
    out = []
    for name, problem in interface_errors(value):
        if name in wanted:
            summary = f"SERVE finds INTERFACE wrong about {display(name)}: {escaped(problem[:MAX_PROBLEM])}"
            hint = "INTERFACE runs again with this, once if this run made it; else: octoform apply -replace interface"
            out.append(error("SERVE-INTERFACE-WRONG", summary, span=Span(1, 1), hint=hint))
        else:
            summary = f"{display(name)} is not a tool of INTERFACE, so nothing is wrong with it there"
            hint = "name a tool of the INTERFACE artifact in interface-errors"
            out.append(error("SERVE-TOOLS-DIFFER", summary, span=Span(1, 1), hint=hint))
    return out


def tool_not_logged(value: str, _: Artifacts) -> list[Diagnostic]:
    """Each tool writes its call and its result into the log."""
    source = needed_source(value)
    hint = "put @runtime.logged directly below @mcp.tool(...)"
    return [
        source.problem("SERVE-TOOL-NOT-LOGGED", site.node, f"the tool {display(site.name)} is not logged", hint)
        for site in tool_sites(source)
        if not site.logged
    ]


def passthrough(value: str, _: Artifacts) -> list[Diagnostic]:
    """No registered tool is a raw pipe."""
    source = needed_source(value)
    hint = "serve what the device does, with typed parameters"
    return [
        source.problem("SERVE-PASSTHROUGH", site.node, f"the tool {display(site.name)} is a raw pipe", hint)
        for site in tool_sites(source)
        if site.name is not None and is_passthrough(site.name)
    ]


def beyond_tools(value: str, _: Artifacts) -> list[Diagnostic]:
    """The server offers tools alone: no resource, no prompt, no middleware, no other server."""
    source = needed_source(value)
    servers = _servers(source)
    hint = (
        "serve tools with @mcp.tool and nothing else; of the server, only mcp.tool, mcp.add_tool and mcp.run are used"
    )
    out = []
    for node in source.nodes:
        if isinstance(node, ast.Call) and source.dotted(node.func).rpartition(".")[2] == "FastMCP":
            names = [item.arg or "**" for item in node.keywords if item.arg not in _PLAIN_OPTIONS]
            out += [
                source.problem("SERVE-BEYOND-TOOLS", node, f"the server is made with {display(name)}", hint)
                for name in names
            ]
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load) and node.id in servers:
            above = source.parents.get(node)
            if not isinstance(above, ast.Attribute):
                summary = f"{display(node.id)} is handed on, so what is registered on it cannot be seen"
                out.append(source.problem("SERVE-BEYOND-TOOLS", node, summary, hint))
            elif above.attr not in _PLAIN_USES:
                summary = f"{display(source.dotted(above))} reaches past the tools"
                out.append(source.problem("SERVE-BEYOND-TOOLS", above, summary, hint))
    return out


def description_differs(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A client reads INTERFACE's description of each tool, and none that no contract has seen."""
    source = needed_source(value)
    hint = "take the description of INTERFACE word by word as the docstring, without the paragraph of Through"
    out = []
    for site, tool in served_tools(source, artifacts):
        functions = tool_functions(source, site)
        whole = str(tool.get("description", ""))
        plain = "\n\n".join(each for each in whole.split("\n\n") if not each.startswith("Through"))
        shown = _description(site, functions[0]) if len(functions) == 1 else None
        if whole and shown is not None and shown.split() not in (whole.split(), plain.split()):
            summary = f"the tool {display(site.name or '')} has another description than INTERFACE gives it"
            out.append(as_warning(source.problem("SERVE-DESCRIPTION-DIFFERS", functions[0], summary, hint)))
    return out


CROSSED = "SERVE-ARGUMENTS-CROSSED"
_SIZES = frozenset({"width", "height"})
_PROPERTIES = {"3": "width", "4": "height", "CAP_PROP_FRAME_WIDTH": "width", "CAP_PROP_FRAME_HEIGHT": "height"}
"""Which side of a picture OpenCV sets by a property, by its name and its number (videoio.hpp)."""
_QUARTERS = frozenset({"rotate", "rot90", "transpose", "swapaxes"})
HELPERS = 4
"""How many functions of the file an argument is followed into, one called by the other."""


def arguments_crossed(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool passes each argument on under its own name: no two of them in each other's place."""
    source = needed_source(value)
    own = source.called_by_name
    hint = "pass each argument to the parameter of its own name"
    out = []
    for site, tool in served_tools(source, artifacts):
        taken = {*(tool["input_schema"].get("properties") or {})}
        roots = tool_functions(source, site) if len(taken) > 1 else []
        for call, _ in source.calls:
            if source.owner(call) not in roots:
                continue
            pairs = _names_passed(own, call)
            crossed = [(one, two) for one, two in pairs if one < two and two in taken and (two, one) in pairs]
            for one, two in (each for each in crossed if each[0] in taken):
                names = f"{display(one)} and {display(two)}"
                summary = f"the tool {display(site.name or '')} passes {names} in each other's place"
                out.append(source.problem(CROSSED, call, summary, hint))
        sides = taken >= _SIZES and not turns_pictures(source)
        for node in _sides_exchanged(source, source.entered_from(roots)) if sides else ():
            summary = f"the tool {display(site.name or '')} takes the width and the height in each other's place"
            out.append(source.problem(CROSSED, node, summary, hint))
    return out


def turns_pictures(source: Source) -> bool:
    """Whether the file turns a picture by a quarter: its width is the height of what the camera gives then."""
    return any(name.rpartition(".")[2] in _QUARTERS for _, name in source.calls)


def _sides_exchanged(source: Source, used: Collection[Function]) -> Iterator[ast.expr | ast.stmt]:
    """Where the width of a picture is set as its height, or the one name is given the value of the other."""
    for item in (each for function in used for part in function.body for each in walk(part)):
        if isinstance(item, ast.Call) and isinstance(item.func, ast.Attribute) and item.func.attr == "set":
            key, given = item.args if len(item.args) == 2 else (None, None)
            named = key.attr if isinstance(key, ast.Attribute) else str(getattr(key, "value", ""))
            side = _PROPERTIES.get(named)
            passed = (
                {each.id for each in walk(given) if isinstance(each, ast.Name)} & _SIZES if given is not None else set()
            )
            if side is not None and passed and side not in passed:
                yield item
        elif (
            isinstance(item, ast.Assign)
            and isinstance(item.targets[0], ast.Tuple)
            and isinstance(item.value, ast.Tuple)
        ):
            pairs = [
                (getattr(one, "id", ""), getattr(two, "id", ""))
                for one, two in zip(item.targets[0].elts, item.value.elts, strict=False)
            ]
            certain = not any(isinstance(above, ast.If) for above, _ in source.above(item))
            if certain and {("width", "height"), ("height", "width")} <= {*pairs}:
                yield item


def is_used(source: Source, function: Function, name: str, depth: int = HELPERS) -> bool:
    """Whether a parameter is used, by the function itself or by those of the file that it is passed on to."""
    uses = [item for part in function.body for item in walk(part) if isinstance(item, ast.Name) and item.id == name]
    for item in uses:
        passed = passed_on(source, item)
        if passed is None or depth == 0 or isinstance(item.ctx, ast.Store):
            return True
        if any(is_used(source, passed[0], each, depth - 1) for each in passed[1]):
            return True
    return False


def passed_on(source: Source, use: ast.Name) -> tuple[Function, list[str]] | None:
    """The function of the file that the name is an argument of a call of, and the parameters that get it."""
    own = source.called_by_name
    call: ast.AST | None = source.parents.get(use)
    while isinstance(call, ast.keyword | ast.Starred | ast.Tuple | ast.List):
        call = source.parents.get(call)
    inner = _entered(own, call) if isinstance(call, ast.Call) else None
    passed = [each for each, given in _names_passed(own, call) if given == use.id] if isinstance(call, ast.Call) else []
    return (inner, passed) if inner is not None and passed else None


WISHED = regex(r"(?i)wish|prefer|nearest|closest|if possible|where possible|hint|at best")


def binds(tool: JsonObject, name: str, loaded: set[str]) -> bool:
    """Whether a reading has to go by an argument: a limit in time, and a number where others of its kind are used.

    A choice, or a number that its description calls a wish, need not be used: the device may decide. The size of a
    picture is asked of the camera all the same, which then takes the nearest.
    """
    members = tool["input_schema"].get("properties") or {}
    member = members[name] if isinstance(members[name], dict) else {}
    counts = member.get("type") in ("integer", "number") and bool(loaded & members.keys() - {"device"})
    if _SIZES & {*tokens(name)} and member.get("type") in ("integer", "number", "string"):
        return True
    return name == "device" or is_time(name) or (counts and not WISHED.search(member.get("description", "")))


def _entered(own: Mapping[str, Function], call: ast.Call) -> Function | None:
    """The function of the file that a call enters, itself or as what it hands on: runtime.child.call(function, ...)."""
    function = own.get(getattr(call.func, "id", ""))
    if function is None and call.args and isinstance(call.args[0], ast.Name):
        function = own.get(call.args[0].id)
    return function


def _names_passed(own: Mapping[str, Function], call: ast.Call) -> set[tuple[str, str]]:
    """(parameter, name that is passed for it) of a call of a function of the file, or of one that is handed on."""
    function, given = _entered(own, call), list(call.args)
    given = given[1:] if own.get(getattr(call.func, "id", "")) is None else given
    pairs = [item.value if isinstance(item, ast.Starred) else ast.Tuple([item]) for item in given]
    if function is None or not all(isinstance(item, ast.Tuple | ast.List) for item in pairs):
        return set()
    given = [each for item in pairs if isinstance(item, ast.Tuple | ast.List) for each in item.elts]
    names, known, _, _ = parameters(function)
    passed = [*zip(names, given, strict=False), *((item.arg, item.value) for item in call.keywords)]
    return {(name, item.id) for name, item in passed if isinstance(item, ast.Name) and name in known}


RULES = (
    Rule("SERVE-INTERFACE-WRONG", interface_blamed),
    Rule("SERVE-NO-SERVER", no_server),
    Rule("SERVE-BEYOND-TOOLS", beyond_tools),
    Rule("SERVE-TOOLS-DIFFER", tools_differ),
    Rule("SERVE-TOOL-NOT-LOGGED", tool_not_logged),
    Rule("SERVE-PASSTHROUGH", passthrough),
    Rule(CROSSED, arguments_crossed),
    Rule("SERVE-DESCRIPTION-DIFFERS", description_differs),
)


@lru_cache(maxsize=4)
def tool_sites(source: Source) -> tuple[ToolSite, ...]:
    """Each place that registers a tool: a decorated function, ``mcp.tool(...)`` on one, or ``add_tool``."""
    return tuple(_registrations(source))


def _description(site: ToolSite, function: Function) -> str | None:
    """What a client reads of a tool; None where it is not written down as it is registered."""
    registered = [site.node] if isinstance(site.node, ast.Call) else function.decorator_list
    calls = [each for item in registered for each in walk(item) if isinstance(each, ast.Call)]
    given = [item for call in calls for item in call.keywords if item.arg in ("description", None)]
    if given:
        return _constant(given[0].value) if given[0].arg else None
    return ast.get_docstring(function) or ""


def _registrations(source: Source) -> Iterator[ToolSite]:
    servers = _servers(source)
    decorators: set[ast.AST] = set()
    for function in source.functions:
        for index, item in enumerate(function.decorator_list):
            call = item if isinstance(item, ast.Call) else None
            if not _registers(call.func if call else item, servers):
                continue
            decorators.add(item)
            name = _given_name(call) if call else _NO_NAME
            below = function.decorator_list[index + 1 :]
            logged = any(_is_logging(source, other) for other in below)
            yield ToolSite(function.name if name is _NO_NAME else _constant(name), function, logged)
    for call, _ in source.calls:
        if call not in decorators and _registers(call.func, servers) and source.parents.get(call) not in decorators:
            yield _call_site(source, call)


def served_tools(source: Source, artifacts: Artifacts) -> Iterator[tuple[ToolSite, JsonObject]]:
    """Each registered tool with its entry in INTERFACE."""
    tools = {tool["name"]: tool for tool in (artifacts.interface or {"tools": []})["tools"]}
    for site in tool_sites(source):
        if site.name in tools:
            yield site, tools[site.name]


def readings_of(tool: JsonObject, artifacts: Artifacts) -> list[JsonObject]:
    """The tools that read one of the devices that a tool sets."""
    tools = (artifacts.interface or {"tools": []})["tools"]
    return [item for item in tools if item["effect"] == "read" and set(item["devices"]) & set(tool["devices"])]


def tool_functions(source: Source, site: ToolSite) -> list[Function]:
    """The functions that a call of the tool runs first: the registered one, or those that the registration names."""
    if not isinstance(site.node, ast.Call):
        return [item for item in source.functions if item is site.node]
    named = {item.id for item in walk(site.node) if isinstance(item, ast.Name)}
    return [item for item in source.functions if item.name in named]


def tools_importing(value: str, modules: Collection[str]) -> dict[str, str]:
    """The tools whose code imports one of the top-level modules inside a function, each with the module."""
    source = needed_source(value)
    places = [(source.owner(node), name) for name, node, inside in imported_modules(source) if inside]
    out: dict[str, str] = {}
    for site in tool_sites(source):
        used = source.entered_from(tool_functions(source, site))
        wanted = sorted(name for owner, name in places if owner in used and name in modules)
        if site.name is not None and wanted:
            out[site.name] = wanted[0]
    return out


_NO_NAME = ast.Constant(value=None)


def _servers(source: Source) -> set[str]:
    """The module-level names that are assigned a FastMCP server."""
    out: set[str] = set()
    for statement in source.tree.body:
        if not isinstance(statement, ast.Assign | ast.AnnAssign) or not isinstance(statement.value, ast.Call):
            continue
        if source.dotted(statement.value.func).rpartition(".")[2] == "FastMCP":
            targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
            out.update(item.id for item in targets if isinstance(item, ast.Name))
    return out


def _registers(node: ast.expr, servers: set[str]) -> bool:
    return (
        isinstance(node, ast.Attribute)
        and node.attr in ("tool", "add_tool")
        and isinstance(node.value, ast.Name)
        and node.value.id in servers
    )


def _given_name(call: ast.Call) -> ast.expr:
    for item in call.keywords:
        if item.arg == "name":
            return item.value
    return call.args[0] if call.args else _NO_NAME


def _constant(node: ast.expr) -> str | None:
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else None


def _call_site(source: Source, call: ast.Call) -> ToolSite:
    """``mcp.tool(runtime.logged(f), name="x")``, and ``mcp.tool(name="x")(runtime.logged(f))``."""
    outer = source.parents.get(call)
    wrapped = call.args[0] if call.args else None
    if isinstance(outer, ast.Call) and outer.func is call:
        wrapped = outer.args[0] if outer.args else None
    named = next((item.value for item in call.keywords if item.arg == "name"), None)
    if named is not None:
        name = _constant(named)
    else:
        inner = wrapped.args[0] if isinstance(wrapped, ast.Call) and wrapped.args else wrapped
        name = inner.id if isinstance(inner, ast.Name) else None
    logged = isinstance(wrapped, ast.Call) and _is_logging(source, wrapped)
    return ToolSite(name, call, logged)


def _is_logging(source: Source, node: ast.expr) -> bool:
    function = node.func if isinstance(node, ast.Call) else node
    if isinstance(function, ast.Call):
        function = function.func
    name = source.dotted(function)
    return name.startswith("runtime.") and name.rpartition(".")[2] == "logged"
