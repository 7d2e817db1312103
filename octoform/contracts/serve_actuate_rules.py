"""The rule for SERVE that what acts says so when it asks for its device: twins are then told apart, or it refuses.

A reading of the wrong one of two equal devices misleads; a movement of the wrong one hurts. Only who asks with
`actuate=True` is refused where nothing tells which is meant, so a tool that acts must ask that way.
"""

import ast

from octoform.contracts.model import Artifacts, Rule
from octoform.contracts.serve_device_rules import opens_device
from octoform.contracts.serve_tool_rules import ToolSite, tool_functions, tool_sites
from octoform.contracts.source import Source, needed_source
from octoform.contracts.text import shown
from octoform.diagnostics import Diagnostic

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
            summary = f"the tool {shown(site.name or '')} ({effect}) asks for its device as a reader does"
            out.setdefault(call, source.problem(CODE, call, summary, _HINT))
    return list(out.values())


RULES = (Rule(CODE, actuate_unbound),)


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
