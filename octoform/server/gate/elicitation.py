"""A person approves before a tool runs whose policy is to confirm, in both eras of the protocol.

The handshake era has a way back to the client, on which the question goes while the call waits. From 2026-07-28 on the
question *is* the answer, and the client sends the call again with the person's answer. An approval lives in this
process alone: it holds once, for ten minutes and until an emergency stop comes, for exactly this tool, these arguments
and this caller, so an old answer that is sent again is refused.

Question and answer bear the same number, by which the audit log has them together: in the newer era they are two calls,
and an answer may never come. That number opens nothing.

The call that is asked about holds no bus meanwhile. What a model wrote into the arguments is shown as JSON in ASCII:
it cannot add lines of its own to the question.
"""

import asyncio
import dataclasses
import hashlib
import json
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import anyio
from fastmcp.exceptions import ToolError
from fastmcp.server.context import Context
from fastmcp.server.dependencies import FastMCPRequestContext
from fastmcp.tools.base import InputRequiredToolResult
from mcp.server.request_state import RequestStateBoundary
from mcp.shared.exceptions import MCPError
from mcp_types import (
    CallToolRequestParams,
    ElicitRequest,
    ElicitRequestFormParams,
    ElicitResult,
    InputRequiredResult,
)
from mcp_types.version import MODERN_PROTOCOL_VERSIONS

from octoform.base.files import parse
from octoform.server.internals import low_level

from .calls import Call

VALID_SECONDS = 600.0
OPEN = 1000
"""Questions that may be open at once; the oldest goes first."""
ARGUMENTS_CHARS = 1500
MARK = "octoform/approval"
KEY = "approval"
SCHEMA: dict[str, Any] = {
    "type": "object",
    "properties": {"value": {"type": "boolean", "title": "Allow this one call"}},
    "required": ["value"],
}


@dataclass(frozen=True, slots=True)
class Question:
    """The question to the person: may this call be made? ``source`` states why it is asked."""

    call: Call
    source: str

    @property
    def tool(self) -> str:
        """The tool that would be called."""
        return self.call.entry.name

    def text(self) -> str:
        """One paragraph for a person; hostile text in the arguments stays inside their JSON."""
        shown = json.dumps(self.call.arguments, ensure_ascii=True, default=repr)
        if len(shown) > ARGUMENTS_CHARS:
            shown = f"{shown[:ARGUMENTS_CHARS]}... ({len(shown)} characters)"
        caller, client = self.call.caller.name, self.call.client.words()
        caller = f"{caller} ({client})" if client else caller
        return (
            f"Allow one call of {self.tool} (effect: {self.call.entry.policy.effect}), asked for by {caller}? "
            f"Arguments: {shown}. Why you are asked: {self.source}."
        )

    def digest(self) -> str:
        """Of tool, caller, exactly the arguments that came, and how often everything was stopped, in canonical form."""
        lines = [self.tool, self.call.caller.name, dict(self.call.given), self.call.stops]
        whole = json.dumps(lines, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(whole.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Reply:
    """The result of asking. ``code`` is approved, asked, declined, cancelled, unanswered, unable or replayed;
    ``ask`` is the answer to send for asked, ``text`` what the client is notified of everything but approved,
    ``approval`` the number of the question."""

    code: str
    text: str = ""
    ask: InputRequiredToolResult | None = None
    approval: str = ""


Heard = Callable[[Reply], None]
"""Called with asked when the question goes out, and with unanswered when no answer came."""


UNABLE = Reply(
    "unable",
    "a person has to confirm this call, and this client did not declare that it can ask one (elicitation). "
    "Call it from a client that can, or have the owner allow it in the policy of octopus.yaml",
)
REPLAYED = Reply(
    "replayed",
    "this approval is not valid: it was used already, it expired, an emergency stop came after it, or it was given for "
    "another call. "
    "Call the tool again without it, and the person will be asked again",
)
DECLINED = Reply("declined", "the person declined this call. Do not try it again unless they ask for it")
CANCELLED = Reply("cancelled", "the person closed the question without an answer, so the call was not made")
UNANSWERED = Reply("unanswered", f"no one answered within {VALID_SECONDS:.0f} s, so the call was not made")


@dataclass(frozen=True, slots=True)
class _Open:
    """A question that went out; ``expires`` in seconds of the clock, ``timer`` ends it."""

    approval: str
    digest: str
    expires: float
    heard: Heard
    timer: asyncio.TimerHandle


class Approvals:
    """The questions that are open. In memory alone: after a restart every person is asked again."""

    def __init__(self, clock: Callable[[], float] = time.monotonic, seconds: float = VALID_SECONDS) -> None:
        self._clock = clock
        self._seconds = seconds
        self._open: dict[str, _Open] = {}

    def __len__(self) -> int:
        return len(self._open)

    async def ask(
        self, question: Question, request: FastMCPRequestContext | None, context: Context, heard: Heard
    ) -> Reply:
        """Ask in the era of this request: the answer, or asked when the client will send the call again with it."""
        if request is None or not _can_ask(context):
            return UNABLE
        approval = secrets.token_hex(4)
        heard(Reply("asked", approval=approval))
        if request.protocol_version in MODERN_PROTOCOL_VERSIONS:
            return self._ask_modern(question, approval, heard)
        return dataclasses.replace(await self._ask_now(question, context), approval=approval)

    def answered(self, question: Question, message: CallToolRequestParams) -> Reply | None:
        """The person's answer, when the call brings one; None when no one was asked yet. An answer counts once."""
        nonce = _nonce(message.request_state)
        if nonce is None:
            return None if message.request_state is None and not message.input_responses else REPLAYED
        asked = self._open.pop(nonce, None)
        if asked is None:
            return REPLAYED
        asked.timer.cancel()
        reply = REPLAYED
        if secrets.compare_digest(asked.digest, question.digest()) and self._clock() <= asked.expires:
            answer = (message.input_responses or {}).get(KEY)
            reply = _reply(answer) if isinstance(answer, ElicitResult) else CANCELLED
        return dataclasses.replace(reply, approval=asked.approval)

    def end(self) -> None:
        """Close every question; no one can answer any more."""
        for nonce in tuple(self._open):
            self._lapse(nonce, "the endpoint ended before anybody answered, so the call was not made")

    def _lapse(self, nonce: str, text: str = UNANSWERED.text) -> None:
        asked = self._open.pop(nonce, None)
        if asked is not None:
            asked.timer.cancel()
            asked.heard(Reply("unanswered", text, approval=asked.approval))

    def _ask_modern(self, question: Question, approval: str, heard: Heard) -> Reply:
        while len(self._open) >= OPEN:
            self._lapse(next(iter(self._open)), f"{OPEN} newer questions came before anybody answered")
        nonce = secrets.token_urlsafe(24)
        timer = asyncio.get_running_loop().call_later(self._seconds, self._lapse, nonce)
        self._open[nonce] = _Open(approval, question.digest(), self._clock() + self._seconds, heard, timer)
        params = ElicitRequestFormParams(message=question.text(), requested_schema=SCHEMA)
        ask = InputRequiredResult(
            result_type="input_required",
            input_requests={KEY: ElicitRequest(params=params)},
            request_state=json.dumps({MARK: nonce}),
        )
        return Reply("asked", ask=InputRequiredToolResult(ask), approval=approval)

    async def _ask_now(self, question: Question, context: Context) -> Reply:
        try:
            with anyio.fail_after(self._seconds):
                answer = await context.session.elicit(
                    message=question.text(), requested_schema=SCHEMA, related_request_id=context.request_id
                )
        except TimeoutError:
            return UNANSWERED
        except (MCPError, ToolError):  # the connection has no way back, or the client refused the question
            return UNABLE
        return _reply(answer)


def overhear(server: Any, heard: Callable[[str, str], None]) -> None:
    """Call ``heard`` with tool and reason for every answer that the protocol's library turns away before the gate.

    It seals what goes out with a question, and refuses by itself what comes back altered, late, or with another call.
    """
    middleware = low_level(server).middleware
    place = next((at for at, each in enumerate(middleware) if isinstance(each, RequestStateBoundary)), None)
    if place is not None:
        middleware[place] = partial(_overheard, middleware[place], heard)


async def _overheard(boundary: Any, heard: Callable[[str, str], None], context: Any, call_next: Any) -> Any:
    """What the library's own guard lets through goes on; what it refuses, no one behind it has seen."""
    passed = False

    async def go_on(inner: Any) -> Any:
        nonlocal passed
        passed = True
        return await call_next(inner)

    try:
        return await boundary(context, go_on)
    except MCPError as problem:
        if not passed and context.method == "tools/call":
            heard(str((context.params or {}).get("name")), problem.error.message)
        raise


def _can_ask(context: Context) -> bool:
    """Whether the client declared that it shows forms to a person."""
    capabilities = context.session.client_capabilities
    elicitation = capabilities.elicitation if capabilities is not None else None
    return elicitation is not None and (elicitation.form is not None or elicitation.url is None)


def _nonce(state: str | None) -> str | None:
    try:
        found = parse(state) if state else None
    except ValueError:
        return None
    nonce = found.get(MARK) if isinstance(found, dict) else None
    return nonce if isinstance(nonce, str) else None


def _reply(answer: ElicitResult) -> Reply:
    if answer.action == "accept":
        return Reply("approved") if (answer.content or {}).get("value") is True else DECLINED
    return DECLINED if answer.action == "decline" else CANCELLED
