"""What a trial may do with the hardware: call a tool of the live endpoint, and look at what it moves.

Both go through the endpoint as any client's calls do, so that policy, limits, emergency stop and audit hold for them.
The person who switched the step on in the manifest has said yes to its movements; nothing else is agreed to.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from octoform.diagnostics import Diagnostic
from octoform.endpoint.client.terminal import Nobody, Wanted, call
from octoform.perception.capture import take
from octoform.perception.image_quality import Picture
from octoform.state.layout import Layout

CALL_SECONDS = 60.0
"""The longest that one call is waited for; the endpoint itself ends most tools earlier."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What came of a call: the structured result, or in ``words`` why there is none.

    ``refused``: the endpoint did not let it through (policy, limit, emergency stop, an argument that does not fit).
    ``over``: no further call can do better, because the endpoint does not answer or the emergency stop is latched.
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
    """Whoever carries out what a trial asks for."""

    def call(self, tool: str, arguments: Mapping[str, Any]) -> Answer:
        """Call a tool; never raises for what comes of it."""

    def look(self, view: Mapping[str, Any]) -> Seen:
        """Take a picture by ``{"tool", "arguments"}``; never raises for what comes of it."""


class _Beforehand(Nobody):
    """The person who has switched the step on: asked by the endpoint, they have said yes."""

    def approves(self, *_: object) -> bool | None:
        """Yes, whatever the call: the endpoint asks only where the policy lets it."""
        return True


class LiveHand:
    """The hand that reaches the hardware, through the live endpoint of a host."""

    def __init__(self, layout: Layout) -> None:
        self._layout = layout

    def call(self, tool: str, arguments: Mapping[str, Any]) -> Answer:
        """Call a tool as a client; the endpoint is started when nothing runs."""
        wanted = Wanted(tool, dict(arguments), seconds=CALL_SECONDS, approved=True)
        result, found = call(self._layout, wanted, _Beforehand())
        if result is None:
            problem = found[0]
            words = f"{problem.summary}: {problem.detail}" if problem.detail else problem.summary
            refused = problem.code != _TIMEOUT
            return Answer(None, words, refused=refused, over=problem.code not in _OF_THE_CALL)
        if result.dry:
            return Answer(None, result.message, refused=True)
        if result.is_error:
            return Answer(None, result.message, refused=result.refused is not None, over=result.refused == "estop")
        return Answer(result.structured or {})

    def look(self, view: Mapping[str, Any]) -> Seen:
        """Take a picture and have it decoded in the serving environment."""
        taken = take(self._layout, view, _Beforehand())
        if isinstance(taken, Diagnostic):
            return Seen(None, words=f"{taken.summary}: {taken.detail}" if taken.detail else taken.summary)
        return Seen(taken.picture, taken.data, taken.mime)


_TIMEOUT = "ENDPOINT-CALL-TIMEOUT"
_OF_THE_CALL = frozenset({_TIMEOUT, "ENDPOINT-UNKNOWN-TOOL", "ENDPOINT-BAD-ARGUMENT", "ENDPOINT-CALL-NOT-APPROVED"})
"""Problems of one call, which another call need not have."""
