"""The verdict on a check of the endpoint: faults of the server are errors, environment problems are warnings.

A tool that raises AttributeError is wrong on every host; a tool that finds its device unplugged, busy or not
permitted is right, and refusing it would keep a host from ever being onboarded.
"""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import Any

from octoform.base.quantities import BOUNDS, COUNTS, is_possible, last_word, unit_in, unit_of_name, unit_of_text
from octoform.diagnostics import Diagnostic, error, has_errors, warning
from octoform.patterns import regex
from octoform.policy.resolve import LINE
from octoform.records import dataclass

# What a check of the endpoint saw, as values.


@dataclass(frozen=True, slots=True)
class SampleCallResult:
    """One test call, and its repetitions.

    ``device`` is the one that the call was for, where it is known. ``skipped`` is the reason why there was none.
    ``error_class`` is the exception's class as the log has it, or ``Timeout``, ``OutputSchema``, ``ResultRefused``,
    ``Protocol``, ``BadArgument``. ``logged`` means that the log has both call and result, ``ended_well`` is what
    that result states. ``pictures`` holds
    ``{"bytes", "mean", "spread"}`` for each picture of the answer, brightness in 0..255. ``results`` are the structured
    results of all calls that were made, ``raw`` the numbers that the tool read meanwhile, one table for each.
    """

    tool: str
    ok: bool
    skipped: str | None = None
    error_class: str | None = None
    message: str | None = None
    ms: float | None = None
    logged: bool = False
    ended_well: bool | None = None
    pictures: tuple[dict[str, Any], ...] = ()
    device: str | None = None
    results: tuple[Any, ...] = ()
    raw: tuple[Mapping[str, float], ...] = ()

    @property
    def content(self) -> bool:
        """Whether an answer has anything in it."""
        return any(map(has_content, self.results)) or bool(self.pictures)


@dataclass(frozen=True, slots=True)
class CheckReport:
    """The client's observations. ``tools`` are the served tools with their schemas, as the artifacts spell them."""

    answered: bool
    error: str | None
    protocol: str | None
    server: dict[str, Any] | None
    tools: tuple[dict[str, Any], ...]
    calls: tuple[SampleCallResult, ...]
    seconds: float
    survivors: int = 0
    log: str = ""
    unrecorded: Diagnostic | None = None


# Whether the results of a test call can be true: physical bounds, the device that was asked, numbers that move.
#
# A result that satisfies its schema may still be nonsense: millidegrees reported as degrees, the reading of another
# device, a constant.

_NAMES = frozenset({"device", "device_id"})
_MOVED = 0.1
"""A reading that moved by a tenth shows in a result, however it is rounded."""


def out_of_bounds(result: Any, schema: Any) -> list[str]:
    """``member: value unit, beyond bounds`` for each number of a result that no device can have measured."""
    return [
        f"{where or 'the result'}: {value:g} {unit}, which no device measures ({low:g} to {high:g} are possible)"
        for where, value, unit in _measured(result, schema, "", None)
        for low, high in [BOUNDS[unit]]
        if not is_possible(value, unit)
    ]


def has_content(result: Any) -> bool:
    """Whether a result has anything: an empty list, null and a state called unknown prove no device."""
    if isinstance(result, Mapping):
        return any(has_content(value) for name, value in result.items() if name not in _NAMES)
    if isinstance(result, list):
        return any(map(has_content, result))
    return result is not None and result not in ("", "unknown")


def _is_null(result: Any) -> bool:
    """Whether each member of a result but the device is null; an empty list is what a quiet device gives."""
    members = [value for name, value in result.items() if name not in _NAMES] if isinstance(result, Mapping) else []
    return bool(members) and all(value is None for value in members)


def tally(answered: Set[str], tried: Set[str], known: Set[str], empty: Set[str], verb: str = "answered") -> str:
    """How many of the tried read tools answered, which of these with an empty result, and how many were not tried.

    All of them are names of tools; ``known`` are those that were to be called.
    """
    parts = [f"{len(answered)} of {len(tried)} read tools {verb}"]
    parts += [f"{', '.join(sorted(empty))} with nothing in it"] if empty else []
    parts += [f"{len(known - tried)} not tried"] if known - tried else []
    return ", ".join(parts)


def of_another(call: SampleCallResult, devices: frozenset[str]) -> str | None:
    """The id of another device that a result gives for its own; None where it gives its own, or none."""
    for result in call.results if call.device is not None else ():
        if isinstance(result, dict):
            lines = [result[name] for name in sorted(_NAMES & result.keys()) if result[name] in devices]
            if lines and lines[0] != call.device:
                return str(lines[0])
        named = set(_texts(result)) & devices
        if named and call.device not in named:
            return sorted(named)[0]
    return None


def unmoved(call: SampleCallResult) -> str | None:
    """The attribute that moved while three results stayed the same; None where that was not seen."""
    if len(call.results) < 3 or len(call.raw) < 3:
        return None
    lines = [_numbers(result) for result in call.results]
    if not lines[0] or any(numbers != lines[0] for numbers in lines):
        return None
    return next((name for name in call.raw[0] if _moves([table.get(name) for table in call.raw])), None)


def _moves(values: Sequence[float | None]) -> bool:
    known = [value for value in values if value is not None]
    widest = max(map(abs, known), default=0.0)
    return len(known) == len(values) and widest > 0 and max(known) - min(known) > _MOVED * widest


def _measured(value: Any, schema: Any, where: str, unit: str | None) -> Iterator[tuple[str, float, str]]:
    """(member, number, unit) of each number whose unit is known."""
    if isinstance(value, Mapping):
        beside = unit_of_text(value.get("unit"))
        members = schema.get("properties", {}) if isinstance(schema, Mapping) else {}
        for name, item in value.items():
            inner = members.get(name, {})
            found = inner.get("description") if isinstance(inner, Mapping) else None
            own = unit_of_name(str(name)) or (beside if name in ("value", "reading") else None)
            own = own or (None if last_word(str(name)) in COUNTS else unit_in(found))
            yield from _measured(item, inner, f"{where}.{name}" if where else str(name), own)
    elif isinstance(value, list):
        inner = schema.get("items", {}) if isinstance(schema, Mapping) else {}
        for index, item in enumerate(value):
            yield from _measured(item, inner, f"{where}[{index}]", unit)
    elif isinstance(value, int | float) and not isinstance(value, bool) and unit is not None:
        yield where, float(value), unit


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from _texts(item)


def _numbers(value: Any) -> list[Any]:
    """The numbers of a result in their order; times and counts of calls are numbers too, and then it moves."""
    if isinstance(value, dict | list):
        items = value.values() if isinstance(value, dict) else value
        return [number for item in items for number in _numbers(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


_CODE: tuple[type[BaseException], ...] = (
    *(ArithmeticError, ZeroDivisionError, AssertionError, AttributeError, LookupError, IndexError, KeyError),
    *(ImportError, ModuleNotFoundError, NameError, UnboundLocalError, SyntaxError, IndentationError, TypeError),
    # What Python itself derives from RuntimeError: missing code, and recursion without an end.
    *(kind for kind in RuntimeError.__subclasses__() if kind.__module__ == "builtins"),
)
DEFECTS = frozenset(kind.__name__ for kind in _CODE)
"""Exceptions that say something of the code and nothing of the device."""

UNIFORM_SPREAD = 2.0
"""Standard deviation of brightness (0..255) below which a picture shows nothing; sensor noise alone gives more."""


Lacked = Callable[[str], bool]
"""Whether the host is known to lack a program."""


def judge_check(
    report: CheckReport,
    interface: Mapping[str, Any],
    seen: frozenset[str] = frozenset(),
    lacked: Lacked | None = None,
) -> list[Diagnostic]:
    """Errors and warnings of a check; no errors means that the endpoint is alive and every tried tool is sound.

    ``seen`` are the devices that PROBE saw a moment ago: one that a tool does not find is no fault of the room.
    ``lacked`` returns, for a program that was not found, whether the host is known to lack it; None for every program.
    """
    found = [report.unrecorded] if report.unrecorded else []
    if not report.answered:
        reason = report.error or "no reason was given"
        hint = "start the launcher below .octoform/<host>/endpoint by hand to see its output"
        return [*found, error("ENDPOINT-NO-ANSWER", "the endpoint does not answer", detail=reason, hint=hint)]
    found += _tools(report, {tool["name"] for tool in interface["tools"]})
    tools = {tool["name"]: tool for tool in interface["tools"]}
    devices = frozenset(device for tool in tools.values() for device in tool.get("devices", ()))
    for call in report.calls:
        here = seen & ({call.device} if call.device else set(tools.get(call.tool, {}).get("devices", ())))
        found += _call(call, bool(here), lacked)
        found += _untrue(call, tools.get(call.tool, {}).get("output_schema", {}), devices, here=bool(here))
    found += _silence(report.calls, bool(seen), has_errors(found))
    if report.survivors:
        summary = f"processes of the server still running after the check, ended: {report.survivors}"
        found.append(warning("ENDPOINT-LEFT-RUNNING", summary, hint="a tool must end what it starts before it returns"))
    return found


def _tools(report: CheckReport, wanted: set[str]) -> list[Diagnostic]:
    served = {tool["name"] for tool in report.tools}
    if served == wanted:
        return []
    lines = [f"missing: {name}" for name in sorted(wanted - served)]
    lines += [f"extra: {name}" for name in sorted(served - wanted)]
    return [error("ENDPOINT-TOOLS-DIFFER", "the served tools are not those of the interface", detail="\n".join(lines))]


NOTHING_ANSWERS = "ENDPOINT-NOTHING-ANSWERS"
_ROOM = frozenset({"PermissionError", "BusBusy", "AmbiguousDevice", "Timeout"})
"""Failures that another user, another moment or another room would not have."""


def _silence(calls: Sequence[SampleCallResult], seen: bool, is_reported: bool) -> list[Diagnostic]:
    """Not one read tool answered: a server that does nothing, unless the room alone can be why."""
    tried = [call for call in calls if call.skipped is None]
    tools = {call.tool for call in tried}
    if not tried or is_reported or any(call.ok for call in tried):
        return []
    summary = f"0 of {len(tools)} read tools answered" if len(tools) > 1 else f"{tried[0].tool} did not answer"
    lines = [f"{call.tool}: {call.error_class}: {call.message}" for call in tried[:10]]
    wrong = seen and len(tools) > 1 and not any(call.error_class in _ROOM for call in tried)
    hint = "each read tool has to read its device now; see why each of them failed"
    return [(error if wrong else warning)(NOTHING_ANSWERS, summary, detail="\n".join(lines), hint=hint)]


def _call(call: SampleCallResult, seen: bool, lacked: Lacked | None) -> list[Diagnostic]:
    if call.skipped == LINE:
        summary = f"{call.tool} was not tried: {LINE}"
        return [warning("ENDPOINT-LINE-NOT-TRIED", summary, hint=_KNOWLEDGE)]
    if call.skipped is not None:
        return [warning("ENDPOINT-TOOL-NOT-TRIED", f"{call.tool} was not tried: {call.skipped}", hint=_SMOKE)]
    found = []
    if not call.logged and call.error_class != "Timeout":
        summary = f"the test call of {call.tool} is not in the call log"
        hint = "wrap every tool in runtime.logged, outermost below the tool decorator"
        found.append(error("ENDPOINT-CALL-NOT-LOGGED", summary, detail=call.message, hint=hint))
    if not call.ok:
        found += _failure(call, known=not found, seen=seen, lacked=lacked)
    return found + [_uniform(call, picture) for picture in call.pictures if _is_uniform(picture)]


_KNOWLEDGE = (
    "choose a profile that matches its device (octoform coverage names those that do; octoform profile new DEVICE "
    "drafts one), describe the device (octoform answer), or allow the tool by a rule of `policy` "
    "in octopus.yaml; until then a person is asked at each call"
)
_SMOKE = "give the tool harmless arguments under smoke in the INTERFACE artifact"


def _failure(call: SampleCallResult, *, known: bool, seen: bool, lacked: Lacked | None) -> list[Diagnostic]:
    kind, text = call.error_class or "ToolError", call.message or "no message"
    if kind in ("OutputSchema", "ResultRefused"):
        summary = f"{call.tool} gives a result that its own output schema refuses"
        return [error("ENDPOINT-OUTPUT-INVALID", summary, detail=text)]
    if kind in DEFECTS or kind in ("Protocol", "BadArgument"):
        hint = "another set of packages may fix it; to have the server written again: octoform apply -replace serve"
        return [error("ENDPOINT-TOOL-BROKEN", f"{call.tool} fails in its own code: {kind}: {text}", hint=hint)]
    if not known:  # an error that the log does not hold was reported already
        return []
    report = error if seen else warning
    if kind == "DeviceAbsent":
        summary = f"{call.tool} does not find {call.device or 'its device'}: {text}"
        return [report("ENDPOINT-DEVICE-ABSENT", summary, hint=_ABSENT[seen])]
    program = _program(kind, text)
    if program and lacked is not None and not lacked(program):
        summary = f"{call.tool} could not be tried: {program} is not on this machine, which is not the recorded host"
        return [warning("ENDPOINT-TOOL-FAILED", summary, hint="it is tried when the host itself is applied")]
    if program:
        summary = f"{call.tool} needs the program {program}, which is not installed here"
        return [report("ENDPOINT-PROGRAM-MISSING", summary, hint=_PROGRAM)]
    if kind in _NETWORK or _NETWORK_SAID.search(text):
        summary = f"{call.tool} got no answer over the network: {kind}: {text}"
        return [report("ENDPOINT-NETWORK-FAILED", summary, hint=_REACHED)]
    summary = f"{call.tool} could not reach its device: {kind}: {text}"
    return [warning("ENDPOINT-TOOL-FAILED", summary, hint="check that the device is connected, free and permitted")]


_ABSENT = {
    True: "PROBE saw it a moment ago: ask for it by its id, and for a class of the kernel that it has; or it was "
    "unplugged meanwhile: plug it in and apply again",
    False: "plug it in, or run octoform apply -replace probe where it is gone for good",
}
_PROGRAM = "read the kernel's files instead, or raise ToolError with the program's name and the package that has it"
_REACHED = "a device that the kernel shows needs no network; one that is reached by it must answer from this host"
_NETWORK = frozenset(
    {"ConnectionError", "ConnectionRefusedError", "ConnectionResetError", "ConnectionAbortedError", "gaierror"}
    | {"URLError", "HTTPError", "ConnectError", "ConnectTimeout", "ReadTimeout", "NewConnectionError", "herror"}
)
_NETWORK_SAID = regex(
    r"connection (?:refused|reset)|name or service not known|network is unreachable|no route to host"
    r"|temporary failure in name resolution|getaddrinfo",
    re.IGNORECASE,
)
_MISSING = regex(r"\[Errno 2\] No such file or directory: '([^'/]+)'")


def _program(kind: str, text: str) -> str | None:
    """The program that was not found: a name without a folder, as only a program is looked for."""
    found = _MISSING.search(text) if kind == "FileNotFoundError" else None
    return found[1] if found else None


def _untrue(
    call: SampleCallResult, schema: Mapping[str, Any], devices: frozenset[str], *, here: bool
) -> list[Diagnostic]:
    """Diagnostics for results of a call that cannot be true."""
    found = []
    for_device = f"{call.tool} for {call.device}" if call.device else call.tool
    lines = [line for result in call.results[:1] for line in out_of_bounds(result, schema)]
    if lines:
        hint = "see the scale and the unit of what is read; raise an error for what the device cannot have measured"
        summary = f"{for_device} gives what cannot be measured"
        found.append(error("ENDPOINT-RESULT-IMPLAUSIBLE", summary, detail="\n".join(lines[:10]), hint=hint))
    if other := of_another(call, devices):
        hint = "ask for the device that the caller names, and return its id"
        found.append(error("ENDPOINT-RESULT-OTHER-DEVICE", f"{for_device} answers for {other}", hint=hint))
    if call.ok and here and call.results and all(map(_is_null, call.results)):
        hint = "see with octoform call why nothing can be read; a tool that cannot read its device raises an error"
        summary = f"{for_device} answers with null alone, and PROBE saw the device a moment ago"
        found.append(warning("ENDPOINT-RESULT-EMPTY", summary, hint=hint))
    if moved := unmoved(call):
        values = ", ".join(f"{table[moved]:g}" for table in call.raw)
        hint = "return what was read in this call; nothing remembered, no constant"
        summary = f"{for_device} gave the same numbers in {len(call.raw)} calls, while {moved} was {values}"
        found.append(error("ENDPOINT-RESULT-CONSTANT", summary, hint=hint))
    return found


def _is_uniform(picture: Mapping[str, Any]) -> bool:
    return picture["spread"] is not None and picture["spread"] < UNIFORM_SPREAD


def _uniform(call: SampleCallResult, picture: Mapping[str, Any]) -> Diagnostic:
    figures = f"brightness {picture['mean']} of 255 on average, spread {picture['spread']}, {picture['bytes']} bytes"
    hint = "check if the lens is covered, the scene dark or the first pictures not flushed"
    return warning("ENDPOINT-PICTURE-UNIFORM", f"{call.tool} gave a picture of one colour", detail=figures, hint=hint)
