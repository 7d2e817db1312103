"""The rule for SERVE about time: an ``async`` function never waits in a way that holds up everybody.

All clients of a host share one event loop. A tool without ``async`` runs in a thread of its own and may block as long
as its timeout allows; one with it runs on the loop, and while it sleeps or waits for a program nobody gets an answer.
"""

import ast
import re
from collections.abc import Iterator

from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.source import Function, Source, needed_source
from octoform.contracts.text import shown
from octoform.diagnostics import Diagnostic

_BLOCKING = re.compile(
    r"time\.sleep|subprocess\.(?:run|call|check_call|check_output|getoutput|getstatusoutput)|select\.(?:select|poll)"
    r"|os\.(?:system|popen|wait|wait3|wait4|waitpid)|socket\.create_connection|input|signal\.(?:pause|sigwait)"
    r"|urllib\.request\.urlopen|(?:requests|httpx)\.(?:get|head|post|put|patch|delete|request)"
    r"|serial\.(?:.*\.)?(?:Serial|serial_for_url)|cv2\.VideoCapture"
    r"|runtime\.evdev\.(?:events|rumble)|runtime\.nmea\.sentences"
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
            summary = f"{shown(name)} blocks every client while {shown(owner.name)} waits"
        elif name in blocking:
            summary = f"{shown(name)} blocks ({blocking[name]}), and {shown(owner.name)} calls it on the event loop"
        else:
            continue
        out.append(source.problem("SERVE-ASYNC-BLOCKS", call, summary, hint))
    return out


RULES = (Rule("SERVE-ASYNC-BLOCKS", async_blocks),)


def _blocking_functions(source: Source) -> dict[str, str]:
    """The file's functions without ``async`` that block when they are called, each with the call that does."""
    found: dict[str, str] = {}
    calls = [(source.dotted(call.func), owner.name) for call, owner in _direct_calls(source) if _is_plain(owner)]
    while True:
        more = {
            owner: shown(name) if _BLOCKING.fullmatch(name) else found[name]
            for name, owner in calls
            if owner not in found and (_BLOCKING.fullmatch(name) or name in found)
        }
        if not more:
            return found
        found |= more


def _direct_calls(source: Source) -> Iterator[tuple[ast.Call, Function]]:
    """Every call with the function that makes it; one in a lambda is made by whoever calls that, and left out."""
    for call, _ in source.calls:
        owner = source.owner(call)
        if owner is not None and not any(isinstance(above, ast.Lambda) for above, _ in source.above(call)):
            yield call, owner


def _is_plain(function: Function) -> bool:
    """A call of it runs its body: neither a coroutine nor a generator."""
    return isinstance(function, ast.FunctionDef)
