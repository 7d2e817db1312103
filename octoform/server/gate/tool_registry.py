"""The facts of each tool that are computed when the server is loaded, so that a call is cheap.

A call looks up one object here: what the policy states, how its arguments are coerced, how its result is compared,
which queues it is in. A tool that the policy does not know has no entry, and without an entry nothing is called.
"""

import dataclasses
import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fastmcp.server.context import Context
from fastmcp.server.dependencies import without_injected_parameters
from fastmcp.tools.base import InputRequiredToolResult, Tool, ToolResult
from fastmcp.tools.function_tool import FunctionTool
from fastmcp.utilities.json_schema import dereference_refs
from fastmcp.utilities.types import find_kwarg_by_type
from mcp_types import InputRequiredResult

from octoform.policy.published import Policy, ToolPolicy
from octoform.server.execution.bus_queue import Bus
from octoform.server.execution.work import current, guard
from octoform.server.internals import holds, is_extended, low_level
from octoform.server.process import principal
from octoform.server.restrictions import Subject

from .argument_validation import Check, Coerce, Effective, check, coercion

AT_ONCE = 64
"""Calls that run at the same time, whatever they call."""
OF_ONE_TOOL = 8
"""Calls of one tool without a bus that run at the same time."""


CHANGING = frozenset({"enable_components", "disable_components", "reset_visibility"})
"""The functions with which a tool shows and hides tools for one session."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One tool. ``queues`` in the order in which they are taken; ``silent`` when the tool cannot report progress;
    ``schema`` is that of its arguments; ``pinned`` the tool itself where its name always means it, ``plain`` the same
    where its function needs nothing but its arguments; ``flaw`` states which limit is about no argument of it, if any;
    ``ends`` are the buses of the devices that it stops."""

    name: str
    version: str | None
    policy: ToolPolicy
    coerce: Coerce
    fits: Check | None
    queues: tuple[Bus, ...]
    guarded: bool
    silent: bool
    schema: Mapping[str, Any]
    pinned: FunctionTool | None
    plain: FunctionTool | None
    flaw: str
    ends: tuple[Bus, ...] = ()

    def overtake(self) -> None:
        """A tool that stops runs now: what waits for its devices came before, and moves nothing any more."""
        for bus in self.ends:
            bus.overtake()


class Entries:
    """The tools of a server that may be called at all."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._known: dict[str, Entry] = {}
        self._total = Bus("this endpoint", AT_ONCE)
        self._buses: dict[str, Bus] = {}
        self._units: dict[str, set[str]] = {}
        """Each device's units, by every word that any tool of it has for one."""
        for tool in policy.tools.values():
            words = (
                {word for name, others in tool.units.names.items() for word in (name, *others)} if tool.units else ()
            )
            for device in tool.buses:
                self._units.setdefault(device, set()).update(words)

    def subject(self, tool: str, arguments: Mapping[str, Any]) -> Subject:
        """A call of a tool of the policy as restrictions judge it."""
        policy = self._policy.tools[tool]
        return Subject(tool, arguments, policy.buses, policy.units, self._units)

    def get(self, name: str) -> Entry | None:
        return self._known.get(name)

    def queues(self) -> list[Bus]:
        """Every queue, the endpoint's own last."""
        return [*self._buses.values(), self._total]

    def keeps(self, bus: Bus) -> bool:
        """Whether a stuck call keeps this queue: all but the endpoint's own, which the other tools need."""
        return bus is not self._total

    async def fill(self, server: Any) -> None:
        """Work out every tool that the server has now."""
        for name in {tool.name for tool in await server.list_tools(run_middleware=False)}:
            await self.find(server, name)

    async def find(self, server: Any, name: str) -> Entry | None:
        """The entry of a tool that came after `fill`; None when there is no such tool, or the policy has none."""
        tool = await server.get_tool(name) if name in self._policy.tools else None
        return None if tool is None else self._add(tool, bool(server.strict_input_validation))

    def _add(self, tool: Tool, strict: bool) -> Entry | None:
        policy = self._policy.tools.get(tool.name)
        if policy is None:
            return None
        coerce: Coerce = _as_given
        guarded = isinstance(tool, FunctionTool)
        silent = True
        if isinstance(tool, FunctionTool):
            silent = find_kwarg_by_type(tool.fn, Context) is None
            coerce = coercion(tool.fn, strict)
            guard(tool)
            # The gate keeps the time: FastMCP's own limit would leave a blocking tool running.
            if tool.timeout is not None:
                policy = dataclasses.replace(policy, timeout=min(policy.timeout, tool.timeout))
                tool.timeout = None
        fits = check(tool.output_schema) if isinstance(tool.output_schema, Mapping) else None
        queues = (*self._queues(tool.name, policy), self._total)
        schema, pinned = _schema(tool), _pinned(tool)
        flaw = _flaw(policy, schema)
        plain = pinned if pinned is not None and _plain(pinned) else None
        ends = tuple(self._buses.setdefault(bus, Bus(bus)) for bus in sorted(policy.ends))
        entry = Entry(
            tool.name, tool.version, policy, coerce, fits, queues, guarded, silent, schema, pinned, plain, flaw, ends
        )
        self._known[tool.name] = entry
        return entry

    def _queues(self, name: str, policy: ToolPolicy) -> list[Bus]:
        if not policy.buses:
            return [self._buses.setdefault(f"tool:{name}", Bus(f"the tool {name}", OF_ONE_TOOL))]
        return [self._buses.setdefault(bus, Bus(bus)) for bus in sorted(policy.buses)]


def _pinned(tool: Tool) -> FunctionTool | None:
    """The tool itself where no one but its own server decides who may call it; else None."""
    if not isinstance(tool, FunctionTool) or tool.auth is not None:
        return None
    code = getattr(inspect.unwrap(tool.fn), "__code__", None)
    return tool if code is not None and CHANGING.isdisjoint(code.co_names) else None


def _plain(tool: FunctionTool) -> bool:
    """Whether calling its function with the arguments and converting what it returns is all that the tool does."""
    whole = without_injected_parameters(tool.fn) is tool.fn
    return whole and type(tool) is FunctionTool and tool.task_config.mode == "forbidden"


def _as_given(arguments: Mapping[str, Any]) -> Effective:
    return Effective(dict(arguments))


def _flaw(policy: ToolPolicy, schema: Mapping[str, Any]) -> str:
    """A limit that finds nothing to judge would let everything pass without anybody's knowing."""
    known = schema.get("properties") or {}
    for limit in policy.limits:
        if limit.parameter and limit.parameter not in known:
            return f"its limit on {limit.parameter} ({limit.source}) cannot be kept, because it has no such argument"
    return ""


def _schema(tool: Tool) -> Mapping[str, Any]:
    """The input schema as tools/list shows it, without references."""
    parameters = tool.parameters
    return dereference_refs(parameters) if "$ref" in str(parameters) else parameters


# What runs is what was judged: the tool under guard, not whatever a second look by name would find.
#
# FastMCP looks a tool up by name for every call, through all providers and transforms, and for a call of the newer era
# once more through the whole list, to see which headers it asks for. Both questions have the same answer every time for
# a server that registers its tools as it is loaded, so they are answered from what was worked out then. Most tools need
# nothing but their arguments; their function is called with the very values that were judged. Where a server changes
# what it shows while it runs, or anything else stands before the tool, FastMCP is asked as ever.


def pin(server: Any, entries: Entries) -> None:
    """Answer the server's questions for a tool of the running call, and for input schemas, from the entries."""
    lookup = server.get_tool

    async def get_tool(name: str, version: Any = None) -> Tool | None:
        work = current.get()
        pinned = work.pinned if work is not None and work.tool == name else None
        if pinned is not None and _steady(server, pinned):
            return pinned
        found: Tool | None = await lookup(name, version)
        return found

    def input_schema(name: str) -> Mapping[str, Any] | None:
        entry = entries.get(name)
        visible = entry is not None and entry.policy.effect in principal.current().effects
        return entry.schema if entry is not None and visible else None

    server.get_tool = get_tool
    low_level(server).get_tool_input_schema = input_schema


def innermost(server: Any, middleware: Any, tool: Tool) -> bool:
    """Whether nothing is between this middleware and the tool."""
    return _steady(server, tool) and server.middleware[-1] is middleware and not is_extended(server)


async def straight(tool: FunctionTool, effective: Effective) -> ToolResult:
    """The result of a tool that needs nothing but its arguments, converted as FastMCP does."""
    value = tool.fn(*effective.args, **effective.kwargs)
    if inspect.isawaitable(value):
        value = await value
    if isinstance(value, InputRequiredResult):
        return InputRequiredToolResult(value)
    return tool.convert_result(value)


def _steady(server: Any, tool: Tool) -> bool:
    """Whether the server has nothing between a name and this tool, and still has it."""
    plain = not server.transforms and len(server.providers) == 1 and not server.local_provider.transforms
    return plain and holds(server, tool)
