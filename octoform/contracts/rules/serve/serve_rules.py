"""The whole SERVE contract over one source text: it compiles, and then every rule of the ten families."""

import ast
import re
from collections.abc import Iterator
from dataclasses import replace

from octoform.base.escaping import display
from octoform.contracts.model import Artifacts, JsonObject, Rule
from octoform.contracts.rules.serve import (
    code_rules,
    device_rules,
    exchange_rules,
    line_rules,
    reading_rules,
    tool_rules,
    value_rules,
    write_rules,
)
from octoform.contracts.rules.serve.device_rules import opens_device
from octoform.contracts.rules.serve.tool_rules import ToolSite, tool_functions, tool_sites
from octoform.contracts.server_source import Function, Source, needed_source, read_source
from octoform.diagnostics import Diagnostic

# The rule for SERVE that a tool that acts declares it when it asks for its device: the runtime then distinguishes
# twins, or refuses.
#
# A reading of the wrong one of two equal devices misleads; a movement of the wrong one hurts. Only who asks with
# `actuate=True` is refused where nothing shows which is meant, so a tool that acts must ask that way.

CODE = "SERVE-ACTUATE-UNBOUND"
_HINT = "write runtime.device(id, actuate=True) in a tool that acts"


def actuate_unbound(value: str, artifacts: Artifacts) -> list[Diagnostic]:
    """A tool that is no reading asks for its device with ``actuate=True``, itself or in what it calls."""
    source = needed_source(value)
    effects = {tool["name"]: tool["effect"] for tool in (artifacts.interface or {"tools": []})["tools"]}
    out: dict[ast.Call, Diagnostic] = {}
    for site in tool_sites(source):
        effect = effects.get(site.name or "", "read")
        for call in _unbound(source, site) if effect != "read" else ():
            summary = f"the tool {display(site.name or '')} ({effect}) asks for its device as a reader does"
            out.setdefault(call, source.problem(CODE, call, summary, _HINT))
    return list(out.values())


ACTUATE_RULES = (Rule(CODE, actuate_unbound),)


def _unbound(source: Source, site: ToolSite) -> list[ast.Call]:
    """The calls by which a tool gets a device without saying that it acts; none when a function that it uses does."""
    roots = tool_functions(source, site)
    own = [call for root in roots for call in source.asking(root) if not _acts(call)]
    if own:
        return own
    used = source.entered_from(roots)
    asking = [call for function in used for call in source.asking(function)]
    if any(_acts(call) for call in asking):
        return []
    opening = [call for call, _ in source.calls if source.owner(call) in used and opens_device(source, call)]
    return (asking or opening)[:1]


def _acts(call: ast.Call) -> bool:
    """Whether it may ask as one that acts: anything but a plain no."""
    given = [item.value for item in call.keywords if item.arg in ("actuate", None)] + call.args[1:2]
    return any(not isinstance(item, ast.Constant) or item.value is True for item in given)


# The rule for SERVE about time: an ``async`` function never waits in a way that holds up everybody.
#
# All clients of a host share one event loop. A tool without ``async`` runs in a thread of its own and may block as long
# as its timeout allows; one with it runs on the loop, and while it sleeps or waits for a program no client gets an
# answer.

_BLOCKING = re.compile(
    r"time\.sleep|subprocess\.(?:run|call|check_call|check_output|getoutput|getstatusoutput)|select\.(?:select|poll)"
    r"|os\.(?:system|popen|wait|wait3|wait4|waitpid)|socket\.create_connection|input|signal\.(?:pause|sigwait)"
    r"|urllib\.request\.urlopen|(?:requests|httpx)\.(?:get|head|post|put|patch|delete|request)"
    r"|serial\.(?:.*\.)?(?:Serial|serial_for_url)|cv2\.VideoCapture"
    r"|runtime\.evdev\.(?:events|rumble)|runtime\.nmea\.sentences|runtime\.child\.call"
)


def async_blocks(value: str, _: Artifacts) -> list[Diagnostic]:
    """No ``async`` function makes a call that is known to block, itself or through a function of the file."""
    source = needed_source(value)
    blocking = _blocking_functions(source)
    hint = "write the tool without async: it then runs in a thread of its own; or await what waits (asyncio.sleep)"
    out = []
    for call, owner in _direct_calls(source):
        if not isinstance(owner, ast.AsyncFunctionDef):
            continue
        name = source.dotted(call.func)
        if _BLOCKING.fullmatch(name):
            summary = f"{display(name)} blocks every client while {display(owner.name)} waits"
        elif name in blocking:
            summary = f"{display(name)} blocks ({blocking[name]}), and {display(owner.name)} calls it on the event loop"
        else:
            continue
        out.append(source.problem("SERVE-ASYNC-BLOCKS", call, summary, hint))
    return out


LOOP_RULES = (Rule("SERVE-ASYNC-BLOCKS", async_blocks),)


def _blocking_functions(source: Source) -> dict[str, str]:
    """The file's functions without ``async`` that block when they are called, each with the call that does."""
    found: dict[str, str] = {}
    calls = [(source.dotted(call.func), owner.name) for call, owner in _direct_calls(source) if _is_plain(owner)]
    while True:
        more = {
            owner: display(name) if _BLOCKING.fullmatch(name) else found[name]
            for name, owner in calls
            if owner not in found and (_BLOCKING.fullmatch(name) or name in found)
        }
        if not more:
            return found
        found |= more


def _direct_calls(source: Source) -> Iterator[tuple[ast.Call, Function]]:
    """Every call with the function that makes it; one in a lambda is made by anyone who calls that, and omitted."""
    for call, _ in source.calls:
        owner = source.owner(call)
        if owner is not None and not any(isinstance(above, ast.Lambda) for above, _ in source.above(call)):
            yield call, owner


def _is_plain(function: Function) -> bool:
    """A call of it runs its body: neither a coroutine nor a generator."""
    return isinstance(function, ast.FunctionDef)


def syntax(value: str, _: Artifacts) -> list[Diagnostic]:
    """The text compiles."""
    source = read_source(value)
    return [] if isinstance(source, Source) else [source]


# `syntax` comes first: the others do not see a source that it refuses.
RULES = (
    Rule("SERVE-SYNTAX", syntax),
    *code_rules.RULES,
    *device_rules.RULES,
    *LOOP_RULES,
    *tool_rules.RULES,
    *ACTUATE_RULES,
    *reading_rules.RULES,
    *value_rules.RULES,
    *write_rules.RULES,
    *line_rules.RULES,
    *exchange_rules.RULES,
)


def serve_static(source: str, interface: JsonObject, path: str = "server.py") -> list[Diagnostic]:
    """Everything that the text of a server shows to be wrong, each with line and column; nothing is run."""
    artifacts = Artifacts(interface=interface)
    found = syntax(source, artifacts)
    if not found:
        found = [item for rule in RULES for item in rule.check(source, artifacts)]
    return [replace(item, path=path) for item in found]
