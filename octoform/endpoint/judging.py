"""What a check of the endpoint means: faults of the server are errors, faults of the room are warnings.

A tool that raises AttributeError is wrong on every host; a tool that finds its device unplugged, busy or not
permitted is right, and refusing it would keep a host from ever being onboarded.
"""

from collections.abc import Mapping
from typing import Any

from octoform.diagnostics import Diagnostic, error, warning
from octoform.endpoint.checkreport import CheckReport, TrialCall

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


def judge_check(report: CheckReport, interface: Mapping[str, Any]) -> list[Diagnostic]:
    """Errors and warnings of a check; no errors means that the endpoint is alive and every tried tool is sound."""
    found = [report.unrecorded] if report.unrecorded else []
    if not report.answered:
        reason = report.error or "no reason was given"
        hint = "start the launcher below .octoform/<host>/endpoint by hand to see what it says"
        return [*found, error("ENDPOINT-NO-ANSWER", "the endpoint does not answer", detail=reason, hint=hint)]
    found += _tools(report, {tool["name"] for tool in interface["tools"]})
    for call in report.calls:
        found += _call(call)
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


def _call(call: TrialCall) -> list[Diagnostic]:
    if call.skipped is not None:
        return [warning("ENDPOINT-TOOL-NOT-TRIED", f"{call.tool} was not tried: {call.skipped}", hint=_SMOKE)]
    found = []
    if not call.logged and call.error_class != "Timeout":
        summary = f"the trial call of {call.tool} is not in the call log"
        hint = "wrap every tool in runtime.logged, outermost below the tool decorator"
        found.append(error("ENDPOINT-CALL-NOT-LOGGED", summary, detail=call.message, hint=hint))
    if not call.ok:
        found += _failure(call, known=not found)
    return found + [_uniform(call, picture) for picture in call.pictures if _is_uniform(picture)]


_SMOKE = "give the tool harmless arguments under smoke in the INTERFACE artifact"


def _failure(call: TrialCall, *, known: bool) -> list[Diagnostic]:
    kind, text = call.error_class or "ToolError", call.message or "no message"
    if kind in ("OutputSchema", "ResultRefused"):
        summary = f"{call.tool} gives a result that its own output schema refuses"
        return [error("ENDPOINT-OUTPUT-INVALID", summary, detail=text)]
    if kind in DEFECTS or kind in ("Protocol", "BadArgument"):
        hint = "another set of packages may mend it; to have the server written again: octoform apply -replace serve"
        return [error("ENDPOINT-TOOL-BROKEN", f"{call.tool} fails in its own code: {kind}: {text}", hint=hint)]
    if not known:  # an error that the log does not hold was told already
        return []
    summary = f"{call.tool} could not reach its device: {kind}: {text}"
    return [warning("ENDPOINT-TOOL-FAILED", summary, hint="see whether the device is connected, free and permitted")]


def _is_uniform(picture: Mapping[str, Any]) -> bool:
    return picture["spread"] is not None and picture["spread"] < UNIFORM_SPREAD


def _uniform(call: TrialCall, picture: Mapping[str, Any]) -> Diagnostic:
    figures = f"brightness {picture['mean']} of 255 on average, spread {picture['spread']}, {picture['bytes']} bytes"
    hint = "see whether the lens is covered, the room dark or the first pictures not flushed"
    return warning("ENDPOINT-PICTURE-UNIFORM", f"{call.tool} gave a picture of one colour", detail=figures, hint=hint)
