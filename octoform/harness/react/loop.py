"""The loop: ask, use the tools that the model calls, append what they say, until it is done.

Turns, money and time are the orchestrator's: it reads along and ends the process. What ends here is a conversation
that is over, a model's side that has failed for good, and a model that calls nothing that can be run.
"""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from string import Template
from typing import Any, TextIO

from octoform.harness.llm.client import Call, Model, Refusal, Reply
from octoform.harness.react.agent_tools import Ready, Toolbox, ToolResult, checked, declared
from octoform.harness.react.chat_history import Conversation
from octoform.harness.react.config import Config

# The agent's events: one JSON object a line, bounded, at once.
#
# ``type`` is reply (text, usage {input, cached, output}), call (tool, text), result (failed, text), alive (pieces),
# `trouble` (text, status, final) or closed (ok, text). The lines are the log of the attempt too, so a result carries
# the end of the tool's output.

SHOWN = 2000


class Reporter:
    """Writes the lines."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def reply(self, text: str, usage: Mapping[str, int]) -> None:
        """The model has replied."""
        self._emit("reply", text=text[:SHOWN], usage=dict(usage))

    def call(self, tool: str, text: str) -> None:
        """A tool is used; ``text`` states for what."""
        self._emit("call", tool=tool[:SHOWN], text=text[:SHOWN])

    def result(self, text: str, failed: bool) -> None:
        """A tool has ended."""
        self._emit("result", failed=failed, text=text[-SHOWN:])

    def alive(self, pieces: int) -> None:
        """A long reply is still coming in."""
        self._emit("alive", pieces=pieces)

    def problem(self, refusal: Refusal, final: bool) -> None:
        """A request failed."""
        self._emit("trouble", text=refusal.text[:SHOWN], status=refusal.status, final=final)

    def closed(self, ok: bool, text: str = "") -> None:
        """The run is over."""
        self._emit("closed", ok=ok, text=text[:SHOWN])

    def _emit(self, kind: str, **fields: Any) -> None:
        # Plain ASCII: whatever a model or a tool prints, a line stays a line.
        self._stream.write(json.dumps({"type": kind, **fields}) + "\n")
        self._stream.flush()


INSTRUCTIONS = Path(__file__).with_name("system.md")
MAX_WRONG = 5
MAX_CALLS = 16


def instructions(config: Config) -> str:
    """The system prompt of one run."""
    return Template(INSTRUCTIONS.read_text(encoding="utf-8")).substitute(
        workdir=config.workdir,
        output=config.output,
        shell_seconds=config.shell_seconds,
        most_shell_seconds=config.most_shell_seconds,
    )


@dataclass(slots=True)
class Loop:
    """One run over a conversation; ``done`` states whether the declared output stands."""

    model: Model
    toolbox: Toolbox
    conversation: Conversation
    reporter: Reporter
    done: Callable[[], bool]
    output: str
    _wrong: int = field(default=0, init=False)
    _was_reminded: bool = field(default=False, init=False)

    def run(self) -> bool:
        """Run to the end; True when it is a good one. Everything is reported to the reporter."""
        while True:
            answer = self._ask()
            if isinstance(answer, Refusal):
                self.reporter.closed(False, answer.text)
                return False
            self.reporter.reply(answer.text, answer.usage)
            answer = _bounded(answer)
            self.conversation.replied(answer)
            if answer.calls:
                self._use(answer.calls)
            elif self._is_over(answer):
                self.reporter.closed(True)
                return True
            if self._wrong >= MAX_WRONG:
                self.reporter.closed(False, f"{self._wrong} replies or calls in a row with which nothing could be done")
                return False

    def _ask(self) -> Reply | Refusal:
        while True:
            answer = self.model.ask(self.conversation.messages(), declared())
            if isinstance(answer, Reply) or not answer.too_long:
                return answer
            if not self.conversation.shrink():
                self.reporter.problem(answer, True)
                return answer

    def _is_over(self, reply: Reply) -> bool:
        """Whether a reply that calls no tool is the end; else the model has been asked to go on."""
        if self.done():
            return True
        if not reply.text.strip():
            self._wrong += 1
            self.conversation.reply("Your reply was empty or could not be read. Call one tool, with valid arguments.")
            return False
        if self._was_reminded:
            return True
        self._was_reminded = True
        self.conversation.reply(
            f"The output file {self.output} is not there, or is empty. Write it now; "
            "if that cannot be done, explain it in one sentence."
        )
        return False

    def _use(self, calls: Sequence[Call]) -> None:
        for call in calls:
            found = self._one(call)
            self.reporter.result(found.text, found.failed)
            self.conversation.returned(call.id, call.name, found.text, len(calls))

    def _one(self, call: Call) -> ToolResult:
        ready = checked(call)
        if isinstance(ready, Ready):
            self._wrong = 0
            self.reporter.call(ready.tool, ready.text)
            return self.toolbox.use(ready)
        self._wrong += 1
        self.reporter.call(call.name or "?", call.arguments)
        return ToolResult(ready, failed=True)


def _bounded(reply: Reply) -> Reply:
    """A reply with no more calls than are made for one."""
    if len(reply.calls) <= MAX_CALLS:
        return reply
    message = {**reply.message, "tool_calls": list(reply.message.get("tool_calls") or ())[:MAX_CALLS]}
    return Reply(reply.text, reply.calls[:MAX_CALLS], message, reply.usage, reply.end)
