"""The conversation with the model, whose size stays bounded however long the run.

Old tool results go first, each replaced by one line, then whole old steps. The instructions, the task and the last
steps always stay. What enters is bounded as well, so that the last steps alone never pass the bound.
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.escaping import escaped
from octoform.base.files import parse
from octoform.harness.llm.client import Reply, size_of

# Text of bounded size: the beginning and the end of a tool's output, the middle omitted.

KEPT = "\n\t\r"


class HeadAndTail:
    """Takes any amount of bytes and keeps at most ``limit`` of them, a third from the beginning."""

    def __init__(self, limit: int) -> None:
        self._most_head = limit // 3
        self._most_tail = limit - self._most_head
        self._head = bytearray()
        self._tail = bytearray()
        self._left_out = 0

    def feed(self, data: bytes) -> None:
        """Take a piece."""
        room = self._most_head - len(self._head)
        self._head += data[:room]
        self._tail += data[max(0, room) :]
        excess = len(self._tail) - self._most_tail
        # The end is cut now and then, not at every piece.
        if excess > self._most_tail:
            self._drop(excess)

    def text(self) -> str:
        """The kept text, decoded with replacement characters."""
        self._drop(max(0, len(self._tail) - self._most_tail))
        head, tail = bytes(self._head), bytes(self._tail)
        if not self._left_out:
            return readable(head + tail)
        return f"{readable(head)}\n[... {self._left_out} bytes omitted ...]\n{readable(tail)}"

    def _drop(self, count: int) -> None:
        del self._tail[:count]
        self._left_out += count


def readable(data: bytes) -> str:
    """Bytes as text in which nothing is hidden."""
    return escaped(data.decode("utf-8", "replace"), KEPT)


def cut(text: str, limit: int) -> str:
    """A string of at most about ``limit`` bytes, its middle omitted."""
    data = text.encode("utf-8", "replace")
    if len(data) <= limit:
        return text
    keeper = HeadAndTail(limit)
    keeper.feed(data)
    return keeper.text()


LIMIT_BYTES = 320 << 10
LEAST_BYTES = 96 << 10
BYTES_PER_TOKEN = 2
"""Of code, JSON and hexadecimal; words alone have twice as many."""
RECENT = 4
TEXT_BYTES = 24 << 10
ARGUMENT_BYTES = 64 << 10
RESULT_BYTES = 48 << 10
"""Bounds of one step: the model's text, the arguments of its calls, and the results of them."""
SHORTEST_REPLACED = 200
NOTE_BYTES = 200
"""For the note on steps that are omitted."""


def limit_for(tokens: int | None, fixed: int) -> int:
    """The bound for a model that takes so many tokens; ``fixed`` bytes always go in."""
    fitting = LIMIT_BYTES if tokens is None else min(LIMIT_BYTES, tokens * BYTES_PER_TOKEN)
    return max(fitting, LEAST_BYTES + fixed)


class Conversation:
    """Messages as litellm takes them; a step is a reply with the results of its calls, or with what it was given."""

    def __init__(self, instructions: str, task: str, tokens: int | None = None) -> None:
        self._opening: list[dict[str, Any]] = [
            {"role": "system", "content": instructions},
            {"role": "user", "content": task},
        ]
        self._steps: list[list[dict[str, Any]]] = []
        self._dropped = 0
        self._limit = limit_for(tokens, size_of(self._opening))

    def messages(self) -> list[dict[str, Any]]:
        """All that is sent next."""
        self._fit()
        note = f"[{self._dropped} earlier steps of this conversation are omitted.]"
        dropped = [{"role": "user", "content": note}] if self._dropped else []
        return [*self._opening, *dropped, *(message for step in self._steps for message in step)]

    def replied(self, reply: Reply) -> None:
        """Add the model's message; arguments that are no JSON object are not repeated to it."""
        message: dict[str, Any] = {"role": "assistant", **reply.message}
        message["content"] = cut(reply.text, TEXT_BYTES) or (None if reply.calls else "(nothing)")
        if reply.calls:
            share = ARGUMENT_BYTES // len(reply.calls)
            written = message.get("tool_calls") or [{}] * len(reply.calls)
            message["tool_calls"] = [
                {
                    **item,
                    "id": call.id,
                    "type": "function",
                    "function": {"name": call.name or "unknown", "arguments": _kept(call.arguments, share)},
                }
                for item, call in zip(written, reply.calls, strict=True)
            ]
        if size_of([message]) > TEXT_BYTES + 2 * ARGUMENT_BYTES:
            message = {name: message[name] for name in ("role", "content", "tool_calls") if name in message}
        self._steps.append([message])

    def returned(self, call_id: str, name: str, text: str, share: int = 1) -> None:
        """A tool has returned; ``share``: to how many calls of this step."""
        shown = cut(text, RESULT_BYTES // share)
        self._steps[-1].append({"role": "tool", "tool_call_id": call_id, "name": name or "unknown", "content": shown})

    def reply(self, text: str) -> None:
        """octoform answers where the model has called no tool."""
        self._steps[-1].append({"role": "user", "content": text})

    def shrink(self) -> bool:
        """Halve the bound, since the model's side finds it too long; False when that cannot be."""
        smaller = max(self._limit // 2, size_of(self._opening) + LEAST_BYTES // 4)
        if smaller >= self._limit:
            return False
        self._limit = smaller
        return True

    def _fit(self) -> None:
        """Bring it below the bound: old results, then old steps, then results of the last steps but the newest.

        A good way below, since every change of what was sent before makes a provider's cache of it worthless.
        """
        size = self._size()
        if size <= self._limit:
            return
        goal = self._limit * 3 // 4
        for step in self._steps[: max(0, len(self._steps) - RECENT)]:
            if size <= goal:
                return
            size -= _shortened(step)
        size = self._drop(size, goal, RECENT)
        for step in self._steps[:-1]:
            if size <= self._limit:
                return
            size -= _shortened(step)
        self._drop(size, self._limit, 1)

    def _drop(self, size: int, goal: int, least: int) -> int:
        """Leave out whole steps, oldest first, until ``goal`` or until only ``least`` are left; the size then."""
        while size > goal and len(self._steps) > least:
            size -= size_of(self._steps.pop(0))
            self._dropped += 1
        return size

    def _size(self) -> int:
        return NOTE_BYTES + size_of([*self._opening, *(message for step in self._steps for message in step)])


def _kept(arguments: str, limit: int) -> str:
    """Arguments as they may be in the conversation."""
    return arguments if parsed(arguments) is not None and len(arguments.encode("utf-8", "replace")) <= limit else "{}"


def parsed(arguments: str) -> dict[str, Any] | None:
    """The object that arguments are, or None."""
    try:
        value = parse(arguments or "{}")
    except ValueError:
        return None
    return value if isinstance(value, dict) else None


def _shortened(step: list[dict[str, Any]]) -> int:
    """Replace the results of a step by one line each; how many bytes that saved."""
    saved = 0
    for place, message in enumerate(step):
        shorter = _noted(message)
        if shorter is not None:
            saved += size_of([message]) - size_of([shorter])
            step[place] = shorter
    return saved


def _noted(message: Mapping[str, Any]) -> dict[str, Any] | None:
    size = len(str(message["content"] or "").encode("utf-8", "replace"))
    if message["role"] != "tool" or size <= SHORTEST_REPLACED:
        return None
    note = f"[{size} bytes of this result are omitted here; use the tool again if you need them]"
    return {**message, "content": note}
