"""A reply in the words of each service: as one JSON value, or as the events of a stream."""

import json
import time
from collections.abc import Callable, Mapping
from typing import Any

from model_server.asked import CHAT, GEMINI, MESSAGES, OLLAMA, RESPONSES, Asked
from model_server.turns import Call, Reply

PIECE = 40
WORDS = {
    400: "This request is not valid.",
    401: "This API key is not valid.",
    403: "This key may not use this model.",
    402: "Your account has no credit left.",
    404: "The model is not there.",
    429: "Too many requests: the limit of this minute is reached.",
    500: "The server had an error while it processed your request.",
    503: "The model is overloaded.",
    529: "Overloaded",
}
"""What services write beside a status; the number itself stands nowhere in it."""
Event = tuple[str | None, Any]
"""The name of an event of a stream (None: it has none) and its data."""


def whole(reply: Reply, asked: Asked) -> dict[str, Any]:
    """The reply as one value."""
    return WHOLE[asked.api](reply)


def streamed(reply: Reply, asked: Asked) -> list[bytes]:
    """The reply as the pieces of a stream."""
    if asked.api == OLLAMA:
        return [json.dumps(_ollama(reply)).encode() + b"\n"]
    return [_framed(name, data) for name, data in EVENTS[asked.api](reply, asked)]


def failure(api: str | None, status: int) -> dict[str, Any]:
    """The body of an HTTP error."""
    text = WORDS.get(status, "something went wrong")
    if api == MESSAGES:
        kinds = {401: "authentication_error", 404: "not_found_error", 429: "rate_limit_error", 529: "overloaded_error"}
        return {"type": "error", "error": {"type": kinds.get(status, "api_error"), "message": text}}
    if api == GEMINI:
        kinds = {400: "INVALID_ARGUMENT", 401: "UNAUTHENTICATED", 404: "NOT_FOUND", 429: "RESOURCE_EXHAUSTED"}
        return {"error": {"code": status, "message": text, "status": kinds.get(status, "INTERNAL")}}
    if api == OLLAMA:
        return {"error": text}
    codes = {401: "invalid_api_key", 429: "rate_limit_exceeded"}
    return {"error": {"message": text, "type": "scripted", "param": None, "code": codes.get(status)}}


def _framed(name: str | None, data: Any) -> bytes:
    text = data if isinstance(data, str) else json.dumps(data)
    return (f"event: {name}\n" if name else "").encode() + f"data: {text}\n\n".encode()


def _pieces(text: str) -> list[str]:
    return [text[start : start + PIECE] for start in range(0, len(text), PIECE)]


# Chat completions


def _chat_usage(reply: Reply) -> dict[str, Any]:
    spent = reply.spent
    return {
        "prompt_tokens": spent.input,
        "completion_tokens": spent.output,
        "total_tokens": spent.input + spent.output,
        "prompt_tokens_details": {"cached_tokens": spent.cached},
    }


def _chat_call(call: Call) -> dict[str, Any]:
    return {"id": call.id, "type": "function", "function": {"name": call.tool, "arguments": call.arguments}}


def _chat(reply: Reply) -> dict[str, Any]:
    message: dict[str, Any] = {"role": "assistant", "content": reply.text or None}
    if reply.calls:
        message["tool_calls"] = [_chat_call(call) for call in reply.calls]
    return {
        "id": reply.id,
        "object": "chat.completion",
        "created": int(time.time()),
        "model": reply.model,
        "choices": [{"index": 0, "message": message, "finish_reason": "tool_calls" if reply.calls else "stop"}],
        "usage": _chat_usage(reply),
    }


def _chat_events(reply: Reply, asked: Asked) -> list[Event]:
    base = {"id": reply.id, "object": "chat.completion.chunk", "created": int(time.time()), "model": reply.model}

    def chunk(delta: dict[str, Any], finish: str | None = None) -> Event:
        return None, {**base, "choices": [{"index": 0, "delta": delta, "finish_reason": finish}]}

    events = [chunk({"role": "assistant", "content": ""})]
    events += [chunk({"content": piece}) for piece in _pieces(reply.text)]
    for place, call in enumerate(reply.calls):
        opening = _chat_call(call)
        opening["function"]["arguments"] = ""
        events.append(chunk({"tool_calls": [{"index": place, **opening}]}))
        for piece in _pieces(call.arguments):
            events.append(chunk({"tool_calls": [{"index": place, "function": {"arguments": piece}}]}))
    events.append(chunk({}, "tool_calls" if reply.calls else "stop"))
    if (asked.body.get("stream_options") or {}).get("include_usage"):
        events.append((None, {**base, "choices": [], "usage": _chat_usage(reply)}))
    return [*events, (None, "[DONE]")]


# Responses


def _items(reply: Reply) -> list[dict[str, Any]]:
    items: list[dict[str, Any]] = []
    if reply.text or not reply.calls:
        content = [{"type": "output_text", "text": reply.text, "annotations": []}]
        message = {"id": f"msg_{reply.id}", "type": "message", "role": "assistant", "status": "completed"}
        items.append({**message, "content": content})
    for call in reply.calls:
        fields = {"id": f"fc_{call.id}", "type": "function_call", "call_id": call.id, "status": "completed"}
        items.append({**fields, "name": call.tool, "arguments": call.arguments})
    return items


def _responses(reply: Reply) -> dict[str, Any]:
    spent = reply.spent
    return {
        "id": reply.id,
        "object": "response",
        "created_at": int(time.time()),
        "status": "completed",
        "model": reply.model,
        "output": _items(reply),
        "usage": {
            "input_tokens": spent.input,
            "input_tokens_details": {"cached_tokens": spent.cached},
            "output_tokens": spent.output,
            "output_tokens_details": {"reasoning_tokens": 0},
            "total_tokens": spent.input + spent.output,
        },
        "parallel_tool_calls": True,
        "tool_choice": "auto",
        "tools": [],
        "error": None,
        "incomplete_details": None,
        "instructions": None,
        "metadata": {},
        "temperature": 1,
        "top_p": 1,
    }


def _responses_events(reply: Reply, _asked: Asked) -> list[Event]:
    final = _responses(reply)
    lines: list[tuple[str, dict[str, Any]]] = [
        ("created", {"response": {**final, "status": "in_progress", "output": [], "usage": None}})
    ]
    for place, item in enumerate(final["output"]):
        at = {"output_index": place, "item_id": item["id"]}
        began = {**item, "status": "in_progress", "content" if item["type"] == "message" else "arguments": ""}
        if item["type"] == "message":
            part = item["content"][0]
            at |= {"content_index": 0}
            began["content"] = []
            lines.append(("output_item.added", {"output_index": place, "item": began}))
            lines.append(("content_part.added", {**at, "part": {**part, "text": ""}}))
            lines += [("output_text.delta", {**at, "delta": piece}) for piece in _pieces(part["text"])]
            lines.append(("output_text.done", {**at, "text": part["text"]}))
            lines.append(("content_part.done", {**at, "part": part}))
        else:
            lines.append(("output_item.added", {"output_index": place, "item": began}))
            lines.append(("function_call_arguments.delta", {**at, "delta": item["arguments"]}))
            lines.append(("function_call_arguments.done", {**at, "arguments": item["arguments"]}))
        lines.append(("output_item.done", {"output_index": place, "item": item}))
    lines.append(("completed", {"response": final}))
    return [
        (f"response.{name}", {"type": f"response.{name}", "sequence_number": number, **data})
        for number, (name, data) in enumerate(lines)
    ]


# Messages


def _messages(reply: Reply) -> dict[str, Any]:
    spent = reply.spent
    content: list[dict[str, Any]] = []
    if reply.text or not reply.calls:
        content.append({"type": "text", "text": reply.text})
    for call in reply.calls:
        given = {"broken": call.arguments} if call.value is None else call.value
        content.append({"type": "tool_use", "id": call.id, "name": call.tool, "input": given})
    return {
        "id": f"msg_{reply.id}",
        "type": "message",
        "role": "assistant",
        "model": reply.model,
        "content": content,
        "stop_reason": "tool_use" if reply.calls else "end_turn",
        "stop_sequence": None,
        "usage": {
            "input_tokens": spent.input - spent.cached,
            "cache_creation_input_tokens": 0,
            "cache_read_input_tokens": spent.cached,
            "output_tokens": spent.output,
        },
    }


def _messages_events(reply: Reply, _asked: Asked) -> list[Event]:
    final = _messages(reply)
    opening = {**final, "content": [], "stop_reason": None, "usage": {**final["usage"], "output_tokens": 1}}
    events: list[Event] = [("message_start", {"type": "message_start", "message": opening})]
    arguments = {call.id: call.arguments for call in reply.calls}
    for place, block in enumerate(final["content"]):
        if block["type"] == "text":
            empty: dict[str, Any] = {"type": "text", "text": ""}
            deltas = [{"type": "text_delta", "text": piece} for piece in _pieces(block["text"])]
        else:
            empty = {**block, "input": {}}
            pieces = _pieces(arguments[block["id"]])
            deltas = [{"type": "input_json_delta", "partial_json": piece} for piece in pieces]
        at = {"index": place}
        events.append(("content_block_start", {"type": "content_block_start", **at, "content_block": empty}))
        events += [("content_block_delta", {"type": "content_block_delta", **at, "delta": delta}) for delta in deltas]
        events.append(("content_block_stop", {"type": "content_block_stop", **at}))
    ending = {"stop_reason": final["stop_reason"], "stop_sequence": None}
    events.append(("message_delta", {"type": "message_delta", "delta": ending, "usage": final["usage"]}))
    return [*events, ("message_stop", {"type": "message_stop"})]


# generateContent


def _gemini(reply: Reply) -> dict[str, Any]:
    parts: list[dict[str, Any]] = [{"text": reply.text}] if reply.text or not reply.calls else []
    # This service parses the arguments itself: broken ones never reach a client.
    broken = any(call.value is None for call in reply.calls)
    parts += [
        {"functionCall": {"id": call.id, "name": call.tool, "args": call.value}}
        for call in reply.calls
        if call.value is not None
    ]
    finish = "MALFORMED_FUNCTION_CALL" if broken else "STOP"
    spent = reply.spent
    return {
        "candidates": [{"content": {"role": "model", "parts": parts}, "finishReason": finish, "index": 0}],
        "usageMetadata": {
            "promptTokenCount": spent.input,
            "cachedContentTokenCount": spent.cached,
            "candidatesTokenCount": spent.output,
            "totalTokenCount": spent.input + spent.output,
        },
        "modelVersion": reply.model,
        "responseId": reply.id,
    }


def _gemini_events(reply: Reply, _asked: Asked) -> list[Event]:
    return [(None, _gemini(reply))]


# Ollama


def _ollama(reply: Reply) -> dict[str, Any]:
    message: dict[str, Any] = {"role": "assistant", "content": reply.text}
    if reply.calls:
        message["tool_calls"] = [{"function": {"name": c.tool, "arguments": c.value or {}}} for c in reply.calls]
    return {
        "model": reply.model,
        "created_at": "2026-01-01T00:00:00Z",
        "done": True,
        "done_reason": "stop",
        "message": message,
        "prompt_eval_count": reply.spent.input,
        "eval_count": reply.spent.output,
    }


WHOLE: Mapping[str, Callable[[Reply], dict[str, Any]]] = {
    CHAT: _chat,
    RESPONSES: _responses,
    MESSAGES: _messages,
    GEMINI: _gemini,
    OLLAMA: _ollama,
}
EVENTS: Mapping[str, Callable[[Reply, Asked], list[Event]]] = {
    CHAT: _chat_events,
    RESPONSES: _responses_events,
    MESSAGES: _messages_events,
    GEMINI: _gemini_events,
}
