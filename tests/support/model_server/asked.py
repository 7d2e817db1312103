"""What a request asks for, whichever of the five services it is meant for."""

import json
import re
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

CHAT, RESPONSES, MESSAGES, GEMINI, OLLAMA = "chat", "responses", "messages", "gemini", "ollama"
ENDINGS = {
    "/chat/completions": CHAT,
    "/responses": RESPONSES,
    "/messages": MESSAGES,
    "/api/chat": OLLAMA,
    ":generateContent": GEMINI,
    ":streamGenerateContent": GEMINI,
}
KEY_HEADERS = ("authorization", "x-api-key", "x-goog-api-key", "api-key")
CALL_ID = re.compile(r"call_t(\d+)n\d+")
IN_PATH = re.compile(r"models/([^:/]+)")


@dataclass(frozen=True)
class Tool:
    """A tool that the client has declared; ``schema`` is that of its arguments."""

    name: str
    schema: dict[str, Any]


@dataclass(frozen=True)
class Asked:
    """One request for a reply; ``raw`` is its body as text."""

    api: str
    model: str
    streams: bool
    tools: tuple[Tool, ...]
    body: dict[str, Any]
    raw: str

    @property
    def turn(self) -> int:
        """How many turns lie behind it, by the ids of the calls (or, where a client drops them, by their results)."""
        found = [int(number) for number in CALL_ID.findall(self.raw)]
        if found:
            return max(found) + 1
        results: int = sum(item.get("role") == "tool" for item in self.body.get("messages") or [])
        for item in self.body.get("contents") or []:
            results += any({"functionResponse", "function_response"} & set(part) for part in item.get("parts") or [])
        return results


def api_of(path: str) -> str | None:
    """The service that a path belongs to; None for anything but a request for a reply."""
    plain = urlsplit(path).path
    return next((api for ending, api in ENDINGS.items() if plain.endswith(ending)), None)


def read(path: str, raw: bytes) -> Asked | None:
    """The request for a reply, or None."""
    api = api_of(path)
    if api is None:
        return None
    text = raw.decode("utf-8", "replace")
    try:
        body = json.loads(text or "{}")
    except ValueError:
        body = {}
    plain = urlsplit(path).path
    named = IN_PATH.search(plain)
    model = body.get("model") or (named.group(1) if named else "scripted")
    streams = bool(body.get("stream", api == OLLAMA)) or "streamGenerate" in plain
    return Asked(api, model, streams, tuple(_tools(api, body)), body, text)


def _tools(api: str, body: dict[str, Any]) -> list[Tool]:
    found = []
    for item in body.get("tools") or []:
        if api in (CHAT, OLLAMA):
            fields = item.get("function") or {}
            found.append(Tool(fields.get("name") or item.get("type", "?"), fields.get("parameters") or {}))
        elif api == MESSAGES:
            found.append(Tool(item.get("name", "?"), item.get("input_schema") or {}))
        elif api == RESPONSES:
            # A tool may be a group of tools; one that the service runs itself has a type and no name.
            found += [
                Tool(fields.get("name") or fields.get("type", "?"), fields.get("parameters") or {})
                for fields in (item, *(item.get("tools") or ()))
            ]
        else:
            found += _declarations(item)
    return found


def _declarations(item: dict[str, Any]) -> list[Tool]:
    declared = item.get("functionDeclarations") or item.get("function_declarations") or []
    own = [name for name in item if name not in ("functionDeclarations", "function_declarations")]
    return [
        *(Tool(text["name"], text.get("parametersJsonSchema") or text.get("parameters") or {}) for text in declared),
        *(Tool(name, {}) for name in own),
    ]
