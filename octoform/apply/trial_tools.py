"""The hardware access of a test: calls of the live endpoint's tools, and pictures.

Both go through the endpoint as any client's calls do, so that policy, limits, emergency stop and audit hold for them.
The person who switched the step on in the manifest has approved its movements; nothing else is agreed to.
"""

from collections.abc import Mapping
from typing import Any, Protocol

from octoform.base.shape import resolve
from octoform.diagnostics import Diagnostic
from octoform.endpoint.client.jsonrpc import ToolCall
from octoform.endpoint.client.terminal import NoTerminal, call
from octoform.perception.capture import Picture, take
from octoform.records import dataclass
from octoform.state.layout import Layout

CALL_SECONDS = 60.0
"""The longest that one call is waited for; the endpoint itself ends most tools earlier."""


@dataclass(frozen=True, slots=True)
class ToolAnswer:
    """The result of a call: the structured result, or in ``words`` why there is none.

    ``refused``: the endpoint did not let it through (policy, limit, emergency stop, an argument that does not fit).
    ``over``: no further call can do better, because the endpoint does not answer or the emergency stop is engaged.
    """

    value: Mapping[str, Any] | None
    words: str = ""
    refused: bool = False
    over: bool = False


@dataclass(frozen=True, slots=True)
class Seen:
    """The figures of a picture with its bytes and media type; in ``words`` why there is none (figures are None)."""

    picture: Picture | None
    data: bytes = b""
    mime: str = ""
    words: str = ""


class Hand(Protocol):
    """Anyone who carries out what a test asks for."""

    def call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        """Call a tool; never raises for what comes of it."""

    def look(self, view: Mapping[str, Any]) -> Seen:
        """Take a picture by ``{"tool", "arguments"}``; never raises for what comes of it."""


class _Beforehand(NoTerminal):
    """The person who has switched the step on: their approval answers the endpoint's question."""

    def approves(self, *_: object) -> bool | None:
        """Yes, whatever the call: the endpoint asks only where the policy lets it."""
        return True


class LiveHand:
    """The hand that reaches the hardware, through the live endpoint of a host."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout

    def call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        """Call a tool as a client; the endpoint is started when nothing runs."""
        wanted = ToolCall(tool, dict(arguments), seconds=CALL_SECONDS, approved=True)
        result, found = call(self._layout, wanted, _Beforehand())
        if result is None:
            problem = found[0]
            words = f"{problem.summary}: {problem.detail}" if problem.detail else problem.summary
            refused = problem.code != _TIMEOUT
            return ToolAnswer(None, words, refused=refused, over=problem.code not in _OF_THE_CALL)
        if result.dry:
            return ToolAnswer(None, result.message, refused=True)
        if result.is_error:
            return ToolAnswer(None, result.message, refused=result.refused is not None, over=result.refused == "estop")
        return ToolAnswer(result.structured or {})

    def look(self, view: Mapping[str, Any]) -> Seen:
        """Take a picture and have it decoded in the serving environment."""
        taken = take(self._layout, ToolCall(view["tool"], view["arguments"]), _Beforehand())
        if isinstance(taken, Diagnostic):
            return Seen(None, words=f"{taken.summary}: {taken.detail}" if taken.detail else taken.summary)
        return Seen(taken.picture, taken.data, taken.mime)


_TIMEOUT = "ENDPOINT-CALL-TIMEOUT"
_OF_THE_CALL = frozenset({_TIMEOUT, "ENDPOINT-UNKNOWN-TOOL", "ENDPOINT-BAD-ARGUMENT", "ENDPOINT-CALL-NOT-APPROVED"})
"""Problems of one call, which another call need not have."""


# What a hardware test switches on by the way is put back: a unit that was limp before it is not left holding, and
# warming up.
#
# The hardware test itself defines what that is and how it is read and set; here it is a number or a boolean like any
# other.

Value = bool | int | float


class Restoring:
    """One value of the device, as it was before a test and afterwards.

    ``wanted`` is the test's member ``restore``; with None nothing is called. ``tools`` are those of INTERFACE by name.
    ``done``: it had changed and was put back. ``over``: no further call makes sense. ``words``: why the
    last call that failed gave nothing.
    """

    def __init__(self, hand: Hand, tools: Mapping[str, Mapping[str, Any]], wanted: Mapping[str, Any] | None) -> None:
        self._hand, self._tools, self._wanted = hand, tools, wanted
        self._first: Value | None = None
        self._last: Value | None = None
        self.done = self.over = False
        self.words = ""

    def remember(self) -> None:
        """Read it before the move."""
        self._first = self._read()

    def put_back(self) -> str | None:
        """Read it again, and set it where it has changed; what stays as it is now, None when all is as it was."""
        if self._wanted is None:
            return None
        if self._first is None:
            return f"{self._place} could not be read before the hardware test, and stays as it is now"
        self._last = self._read()
        if self._last == self._first:
            return None
        if not self.over:
            self._set(self._first)
            self._last = self._read()
        self.done = self._last == self._first
        if self.done:
            return None
        now = "unknown" if self._last is None else display(self._last)
        return f"{self._place} was {display(self._first)} before the hardware test, is {now} now, and stays so"

    @property
    def _place(self) -> str:
        read = (self._wanted or {})["read"]
        return f"{read['value'] or 'the top'} of {read['tool']}"

    def _read(self) -> Value | None:
        if self._wanted is None or self.over:
            return None
        read = self._wanted["read"]
        answer = self._call(read["tool"], read["arguments"])
        value = resolve(answer.value, read["value"])
        return value if isinstance(value, bool | int | float) else None

    def _set(self, value: Value) -> None:
        wanted = (self._wanted or {})["set"]
        given = fitting(value, self._tools[wanted["tool"]], wanted["vary"])
        self._call(wanted["tool"], {**wanted["arguments"], wanted["vary"]: given})

    def _call(self, tool: str, arguments: Mapping[str, Any]) -> ToolAnswer:
        answer = self._hand.call(tool, arguments)
        self.over = self.over or answer.over
        if answer.value is None:
            self.words = answer.words
        return answer


def fitting(value: Value, tool: Mapping[str, Any], parameter: str) -> Value:
    """The value as the parameter takes it: 0 is False for a boolean, False is 0 for a number."""
    kinds = tool["input_schema"].get("properties", {}).get(parameter, {}).get("type")
    kinds = kinds if isinstance(kinds, list) else [kinds]
    if "boolean" in kinds:
        return bool(value)
    return round(value) if "integer" in kinds else value + 0


def display(value: Value) -> str:
    """A value in a sentence: ``0``, ``2.5``, ``true``."""
    return str(value).lower() if isinstance(value, bool) else f"{value:g}"
