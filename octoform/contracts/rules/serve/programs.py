"""Which programs of the system a generated server starts, and which of its tools cannot do without them."""

import ast

from octoform.contracts.rules.serve.code_rules import SPAWN, literal
from octoform.contracts.rules.serve.tool_rules import tool_functions, tool_sites
from octoform.contracts.server_source import Source, needed_source, walk

_MISSING = frozenset({"FileNotFoundError", "OSError", "Exception"})


def programs_of(value: str) -> set[str]:
    """The names of all programs that a server starts."""
    return {name for _, name in _started(needed_source(value))}


def tools_starting(value: str) -> dict[str, list[str]]:
    """Each program to the tools that need it: those that start it and have no other way where it is missing."""
    source = needed_source(value)
    out: dict[str, list[str]] = {}
    needed = [(call, name) for call, name in _started(source) if not _has_other_way(source, call)]
    for site in tool_sites(source):
        used = source.entered_from(tool_functions(source, site))
        for program in sorted({name for call, name in needed if source.owner(call) in used}):
            if site.name is not None:
                out.setdefault(program, []).append(site.name)
    return out


def started_blindly(value: str) -> dict[str, int]:
    """Each program that is started without a word for the case that it is missing, with the line where."""
    source = needed_source(value)
    out: dict[str, int] = {}
    for call, name in _started(source):
        looked = any(each == "shutil.which" and source.owner(one) is source.owner(call) for one, each in source.calls)
        caught = any(
            isinstance(above, ast.Try) and below in above.body and any(map(_catches_missing, above.handlers))
            for above, below in source.above(call)
        )
        if not looked and not caught:
            out.setdefault(name, call.lineno)
    return out


def _catches_missing(handler: ast.ExceptHandler) -> bool:
    kinds = walk(handler.type) if handler.type else ()
    return not handler.type or any(isinstance(item, ast.Name) and item.id in _MISSING for item in kinds)


def _started(source: Source) -> list[tuple[ast.Call, str]]:
    out = []
    for call, name in source.calls:
        if name not in SPAWN:
            continue
        first: ast.expr | None = call.args[0] if call.args else None
        if not name.startswith("asyncio."):
            given = first or next((item.value for item in call.keywords if item.arg == "args"), None)
            listed = literal(source, given)
            first = listed.elts[0] if listed is not None and listed.elts else None
        if isinstance(first, ast.Constant) and isinstance(first.value, str):
            out.append((call, first.value))
    return out


def _has_other_way(source: Source, call: ast.Call) -> bool:
    """Whether a tool goes on where the program is missing: it looks first, or catches that and does not raise."""
    for above, below in source.above(call):
        if isinstance(above, ast.If) and below is not above.test and above.orelse:
            looks = (item for item in walk(above.test) if isinstance(item, ast.Call))
            if any(source.dotted(item.func) == "shutil.which" for item in looks):
                return True
        if isinstance(above, ast.Try) and below in above.body:
            for handler in above.handlers:
                names = (
                    {item.id for item in walk(handler.type) if isinstance(item, ast.Name)}
                    if handler.type
                    else {"OSError"}
                )
                if names & _MISSING and not any(isinstance(item, ast.Raise) for item in walk(handler)):
                    return True
    return False
