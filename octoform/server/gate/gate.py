"""Every call of a tool passes here: who may, whether it may now, with which values, how long, and what comes back.

It is middleware of the process that serves, outside of the generated code, so nothing an agent wrote can leave it out.
The order is fixed: what a caller may not know of does not exist; the emergency stop is looked at before everything
else; arguments are checked before a limit counts or a person is asked; limits count when the call has its buses, just
before it runs, and whatever may have changed while it waited is looked at once more there. From before that look on an
emergency stop finds the call among those that it interrupts: there is no moment in which it is seen by neither.
"""

import asyncio
import itertools
import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import anyio
from fastmcp.exceptions import NotFoundError, ToolError
from fastmcp.exceptions import ValidationError as ArgumentsInvalid
from fastmcp.server.dependencies import fastmcp_request_ctx
from fastmcp.server.middleware import CallNext, Middleware, MiddlewareContext
from fastmcp.tools.base import InputRequiredToolResult, ToolResult
from mcp.shared.exceptions import MCPError
from mcp_types import CallToolRequestParams
from pydantic import ValidationError

from octoform.base.escaping import display
from octoform.policy.enforce import Ledger
from octoform.policy.published import Policy
from octoform.server.audit.audit_log import Audit
from octoform.server.execution.bus_queue import Busy, Holder, abandon, release, take, take_free
from octoform.server.execution.result_size import of_result
from octoform.server.execution.watchdog import WATCHDOG, Workers
from octoform.server.execution.work import FRAMES, Patience, Stopped, TooLarge, Work, current, masked
from octoform.server.internals import mask_errors
from octoform.server.latch import Latch
from octoform.server.process import principal
from octoform.server.process.device_presence import Presence
from octoform.server.process.local_socket import client_of
from octoform.server.restrictions import Restrictions

from . import messages
from .calls import Call, CallRefused, Records, held
from .elicitation import Approvals, Question, Reply, overhear
from .tool_registry import Entries, Entry, innermost, pin, straight

# A sign of life every second while a tool works that sends none itself.
#
# Many clients give up on a call without a message. Only a call that came with a progress token hears anything, and only
# when its tool cannot report by itself; the last sign is sent before the answer.

EVERY = 1.0


class Beat:
    """Sends the elapsed seconds, which only grow, with ``words()`` as the message; from now to `stop`."""

    def __init__(self, context: Any, words: Callable[[], str], every: float = EVERY) -> None:
        self._context = context
        self._words = words
        self._every = every
        self._begun = time.monotonic()
        self._task = asyncio.get_running_loop().create_task(self._send())

    def stop(self) -> None:
        """Stop sending progress."""
        self._task.cancel()

    async def _send(self) -> None:
        while True:
            await asyncio.sleep(self._every)
            elapsed = round(time.monotonic() - self._begun, 3)
            try:
                await self._context.report_progress(elapsed, None, self._words())
            except (anyio.ClosedResourceError, anyio.BrokenResourceError):  # no client listens any more
                return


Context = MiddlewareContext[CallToolRequestParams]
Next = CallNext[CallToolRequestParams, ToolResult]
MESSAGE_CHARS = 300


class Gate(Middleware):
    """The gate of one server. ``arm`` it on the event loop before the first client comes.

    ``on_result`` hears the name and result of every call that went well; ``patience``, ``approvals`` and
    ``restrictions`` are there to be replaced before the first call.
    """

    def __init__(self, policy: Policy, ledger: Ledger, audit: Audit, latch: Latch, presence: Presence) -> None:
        self._policy = policy
        self._ledger = ledger
        self._latch = latch
        self._presence = presence
        self._records = Records(audit)
        self._entries = Entries(policy)
        self._workers = Workers()
        self._running: set[Call] = set()
        self._stops = 0
        self._stop_numbers = itertools.count(1)
        self._server: Any = None
        self.approvals = Approvals()
        self.patience = Patience()
        self.restrictions = Restrictions()
        self.on_result: Callable[[str, ToolResult], None] | None = None

    async def arm(self, server: Any) -> None:
        """Put every tool of the server under guard, mask what its code reveals by accident, and watch this loop."""
        mask_errors(server)
        await self._entries.fill(server)
        pin(server, self._entries)
        overhear(server, self._records.turned_away)
        self._server = server
        WATCHDOG.arm(FRAMES)

    def disarm(self) -> None:
        """Stop what runs and let the threads go; the server ends."""
        self.halt("shutdown", everything=True)
        self.approvals.end()
        self._records.flush()
        self._workers.close()
        WATCHDOG.disarm()

    def halt(self, cause: str = "estop", everything: bool = False) -> list[Work]:
        """Interrupt what moves, from any thread; ``everything``: readings too. What was instructed to stop.

        To be called once the latch is closed: what is not among these has not looked at it yet.
        """
        self.void()
        works = [call.work for call in tuple(self._running) if call.work is not None and (everything or call.moves)]
        for work in works:
            work.halt(cause)
        return works

    def void(self) -> None:
        """Void all waiting calls and approvals, from any thread: they may move nothing any more."""
        self._stops = next(self._stop_numbers)

    def stuck(self) -> list[dict[str, Any]]:
        """The calls whose code did not end although they were stopped: tool, caller, buses, seconds since it began."""
        return [call.shown() for call in tuple(self._running) if call.work is not None and call.work.stuck]

    def status(self) -> dict[str, Any]:
        """For a person who asks how the endpoint is; from any thread."""
        return {
            "mode": self._policy.mode,
            "running": len(self._running),
            "stuck": self.stuck(),
            "approvals": len(self.approvals),
            "audit": self._records.problem,
        }

    async def __call__(self, context: MiddlewareContext[Any], call_next: CallNext[Any, Any]) -> Any:
        # Straight to the point: the general way builds three wrappers for each message.
        if isinstance(context.message, CallToolRequestParams):
            return await self.on_call_tool(context, call_next)
        return await call_next(context)

    async def on_call_tool(self, context: Context, call_next: Next) -> ToolResult:
        """Judge, run and answer one call."""
        call = await self._arrive(context)
        try:
            self._judge(call)
            if call.dry:
                self._records.decided(call, "dry_run")
                return messages.dry_run(call)
            if call.confirms and (ask := await self._confirm(call, context)) is not None:
                return ask
            return await self._pass(call, context, call_next)
        except CallRefused as refused:
            self._records.decided(call, "refuse", code=refused.code, text=str(refused))
            return messages.refusal(refused)

    async def _arrive(self, context: Context) -> Call:
        """The call, for a tool that this caller may know of; FastMCP's own answer for every other name."""
        name = context.message.name
        entry = self._entries.get(name)
        if entry is None and context.fastmcp_context is not None:
            entry = await self._entries.find(context.fastmcp_context.fastmcp, name)
        caller = principal.current()
        request = fastmcp_request_ctx.get()
        client = client_of(request)
        meta = (request.meta if request is not None else None) or {}
        if entry is None or entry.policy.effect not in caller.effects or not _same_version(entry, meta):
            code = "unknown_tool" if entry is None else "hidden_tool"
            fields = {"tool": name, "caller": caller.name, "decision": "refuse", "code": code}
            self._records.write("decision", **fields, **client.fields())
            # FastMCP's own error for this repeats the name whole, however long it is.
            raise ToolError(f"Unknown tool: {display(name)}")
        wants = meta.get(messages.DRY) is True
        dry = wants or (self._policy.mode == "dry_run" and entry.policy.effect != "read")
        arguments = context.message.arguments or {}
        call = Call(self._records.identity(), entry, caller, arguments, dry, time.monotonic(), self._stops)
        call.client = client
        call.beats = entry.silent and "progressToken" in meta
        return call

    def _judge(self, call: Call) -> None:
        """Everything that can be checked without waiting; CallRefused states what stands against the call."""
        entry = call.entry
        self._look_again(call)
        if entry.policy.decision == "deny":
            self._object(call, "denied", f"{entry.name} is denied by {entry.policy.source}")
        try:
            call.effective = entry.coerce(call.given)
        except ValidationError as problem:
            raise CallRefused("invalid", messages.describe(entry.name, problem, entry.schema)) from None
        if entry.flaw:
            self._object(call, "limit_without_argument", f"{entry.name} is refused: {entry.flaw}")
        self._restrict(call)
        # A call that runs at once is judged when it is counted; the others hear now what they would wait for in vain.
        waits = call.dry or call.confirms or not all(queue.free() for queue in entry.queues)
        if waits and call.limited and (refusal := self._ledger.judge(entry.name, call.arguments)) is not None:
            self._object(call, refusal.code, refusal.text)

    def _look_again(self, call: Call) -> None:
        """Check again what may have changed while the call waited for a person or for a bus."""
        if call.moves:
            if (stop := self._latch.engaged()) is not None:
                raise messages.estop(stop)
            if call.stops != self._stops:
                raise messages.overtaken()
        if absent := self._presence.missing(call.entry.name, call.given.get("device")):
            raise messages.absent(absent)

    def _restrict(self, call: Call) -> None:
        """Apply the restrictions of claims: refusals and questions to a person; again when the call has its buses."""
        if not call.moves or call.entry.policy.ends:
            return
        found = self.restrictions.against(self._entries.subject(call.entry.name, call.arguments))
        call.restricted = "" if found is None else found.words
        if found is not None and (found.effect == "deny" or (call.holder is not None and not call.approved)):
            self._object(call, "restricted", found.words)

    def _object(self, call: Call, code: str, text: str) -> None:
        """A refusal; in shadow mode it is only noted."""
        if self._policy.mode != "shadow":
            raise CallRefused(code, text)
        note = f"{code}: {text}"
        if note not in call.noted:
            call.noted.append(note)

    async def _confirm(self, call: Call, context: Context) -> ToolResult | None:
        """Ask a person; None when the call may go on, the question itself where that is the answer."""
        request = fastmcp_request_ctx.get()
        question = Question(call, call.restricted or call.entry.policy.source)
        reply = self.approvals.answered(question, context.message)
        if reply is None:
            if self._policy.mode == "shadow":
                self._object(call, "confirm", "a person would have been asked")
                return None
            if context.fastmcp_context is None:
                raise CallRefused("unable", "a person has to confirm this call, and it came from no client")
            try:
                reply = await self.approvals.ask(question, request, context.fastmcp_context, partial(self._heard, call))
            except asyncio.CancelledError:
                self._records.decided(call, "refuse", code="cancelled", text="cancelled while a person was asked")
                raise
        if reply.ask is not None:
            return reply.ask
        call.asked |= {"approval": reply.approval, "answer": reply.code}
        if reply.code != "approved":
            raise CallRefused(reply.code, reply.text)
        if call.stops != self._stops:
            raise messages.overtaken()
        call.began = time.monotonic()  # the person's time is not the call's
        self._look_again(call)
        return None

    def _heard(self, call: Call, reply: Reply) -> None:
        """Record that a person is asked, before the question goes out, or that no answer came to it."""
        call.asked["approval"] = reply.approval
        if reply.code == "asked":
            self._records.decided(call, "ask")
        else:
            call.asked["answer"] = reply.code
            self._records.decided(call, "refuse", code=reply.code, text=reply.text)

    async def _pass(self, call: Call, context: Context, call_next: Next) -> ToolResult:
        """Take the buses, count, write it down, run. On every way out the buses are free, but for code that goes on."""
        entry = call.entry
        call.holder = holder = Holder(entry.name, call.caller.name, entry.policy.effect, call.caller.effects)
        beat = Beat(context.fastmcp_context, call.words) if call.beats else None
        try:
            if not take_free(entry.queues, holder):
                await self._wait(call, holder)
            work = self._begin(call)
            try:
                self._look_again(call)
                self._restrict(call)
                self._count(call)
                entry.overtake()
                return await self._run(call, work, context, call_next)
            finally:
                work.close()
        finally:
            if call.work is None:
                release(entry.queues, holder)
            if beat is not None:
                beat.stop()

    async def _wait(self, call: Call, holder: Holder) -> None:
        """Queue for the buses, as long as the call may run afterwards."""
        entry = call.entry
        try:
            await take(entry.queues, holder, call.began + entry.policy.timeout)
        except Busy as busy:
            raise CallRefused(busy.code, str(busy)) from None
        except asyncio.CancelledError:
            self._records.decided(call, "refuse", code="cancelled", text="cancelled while it waited for a bus")
            raise
        call.began = time.monotonic()  # what moves must not be cut off in the middle because it had to wait

    def _begin(self, call: Call) -> Work:
        """The work of the call, which from here on can be halted."""
        entry = call.entry
        work = Work(entry.name, self._workers, self.patience, entry.policy.result_bytes)
        work.on_end, work.on_stuck = partial(self._ended, call), partial(self._abandon, call)
        work.pinned = entry.pinned
        call.work = work
        self._running.add(call)
        return work

    def _count(self, call: Call) -> None:
        """The last word: limits are judged and counted at once; the decision is on the log before anything begins."""
        entry = call.entry
        if call.limited and (refusal := self._ledger.reserve(entry.name, call.arguments)) is not None:
            self._object(call, refusal.code, refusal.text)
        if not self._records.decided(call, "allow") and call.moves:
            self._ledger.settle(entry.name, call.arguments, well=False)
            raise CallRefused(
                "audit", f"the audit log cannot be written, so nothing that moves is called: {self._records.problem}"
            )

    async def _run(self, call: Call, work: Work, context: Context, call_next: Next) -> ToolResult:
        """Run the tool's code as work that can be stopped, and make an answer of whatever comes of it."""
        entry = call.entry
        token = current.set(work)
        work.limit(entry.policy.timeout)
        try:
            if call.moves and self._latch.engaged() is not None:  # by another process, while the record was written
                raise Stopped("estop", ended=True)
            if entry.plain is not None and innermost(self._server, self, entry.plain):
                result = await straight(entry.plain, call.effective)
            elif entry.guarded:
                result = await call_next(context)
            else:
                result = await work.run_async(partial(_awaited, call_next, context))
            return self._answer(call, result)
        except asyncio.CancelledError:
            work.stop("cancelled")
            self._records.outcome(call, "cancelled")
            raise
        except (NotFoundError, MCPError):
            self._records.outcome(call, "error")
            raise
        except Exception as problem:  # noqa: BLE001 - every failure of a tool becomes an answer, see _failed
            return self._failed(call, work, problem)
        finally:
            current.reset(token)
            self._ledger.settle(entry.name, call.arguments, well=call.well)

    def _answer(self, call: Call, result: ToolResult) -> ToolResult:
        """The tool's result, unless it is too large or not what the tool's output schema promises."""
        entry = call.entry
        if isinstance(result, InputRequiredToolResult):
            self._records.outcome(call, "asks")
            return result
        if (size := of_result(result, entry.policy.result_bytes)) is not None:
            raise TooLarge(size)
        if result.is_error:
            texts = [str(block.text) for block in result.content if hasattr(block, "text")]
            self._records.outcome(call, "error", text=" ".join(texts))
            return result
        if entry.fits is not None and (problem := entry.fits(result.structured_content)) is not None:
            text = f"the tool's result does not fit its output schema: the result{problem[:MESSAGE_CHARS]}"
            self._records.outcome(call, "invalid_result", text=text)
            return messages.error(text)
        if entry.policy.places and (text := held(call, result.structured_content, self._records, self._ledger)):
            return messages.error(text)
        call.well = True
        if not self._records.outcome(call, "ok"):
            result.meta = {**(result.meta or {}), messages.UNAUDITED: f"not written: {self._records.problem}"}
        if self.on_result is not None:
            self.on_result(entry.name, result)
        return result

    def _failed(self, call: Call, work: Work, problem: Exception) -> ToolResult:
        """The answer to a call that raised: words meant for the client pass, everything else gets a reference."""
        if isinstance(problem, Stopped):
            self._records.outcome(call, problem.cause, ended=problem.ended)
            return messages.error(messages.stopped(call, problem))
        if isinstance(problem, TooLarge):
            self._records.outcome(call, "too_large", bytes=problem.size)
            bound = call.entry.policy.result_bytes
            return messages.error(f"the result is too large: {problem.size} bytes or more, of at most {bound}")
        if isinstance(problem, ArgumentsInvalid) and isinstance(problem.__cause__, ValidationError):
            problem = ArgumentsInvalid(messages.describe(call.entry.name, problem.__cause__, call.entry.schema))
        elif problem is not work.reported and not isinstance(problem, ArgumentsInvalid):
            problem = masked(work, problem.__cause__ or problem)
        fields = {"reference": work.reference} if work.reference else {"text": str(problem)}
        self._records.outcome(call, "error", **fields)
        return messages.error(str(problem))

    def _ended(self, call: Call) -> None:
        """The tool's code is over, or will never begin: its buses go to the next in line."""
        self._running.discard(call)
        if call.holder is not None:
            release(call.entry.queues, call.holder)
        if call.answered and call.work is not None and call.work.begun:
            took = round((time.monotonic() - call.began) * 1000, 2)
            self._records.write("ended", call=call.identity, tool=call.entry.name, ms=took)

    def _abandon(self, call: Call) -> None:
        """The tool's code goes on although it was stopped, and perhaps permanently."""
        self._records.write("stuck", call=call.identity, tool=call.entry.name, buses=list(call.entry.policy.buses))
        if call.holder is not None:
            abandon(call.entry.queues, call.holder, self._entries.keeps)


def _same_version(entry: Entry, meta: Mapping[str, Any]) -> bool:
    """Whether the call means the version of the tool that was put under guard."""
    wanted = meta.get("fastmcp")
    return not isinstance(wanted, Mapping) or wanted.get("version") in (None, entry.version)


async def _awaited(call_next: Next, context: Context) -> ToolResult:
    return await call_next(context)
