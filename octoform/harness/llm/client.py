"""One request to a model: the only module that imports litellm, and what its answers and failures mean.

Replies are streamed, so that a long one can be distinguished from one that has stalled. Retries are ours: the library's
own hide the status of what failed.
"""

import importlib
import json
import os
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from octoform.harness.llm.route import Route
from octoform.records import dataclass, field

RETRIES = 2
BACKOFF_SECONDS = 1.5
MAX_BACKOFF_SECONDS = 20.0
ALIVE_SECONDS = 5.0
BAD_REQUEST = 400
MAX_CAUSES = 20
SEARCH = "web_search_options"
SETTINGS = {
    # Before the import, or it asks the network for a list of prices.
    "LITELLM_LOCAL_MODEL_COST_MAP": "True",
    "LITELLM_LOG": "ERROR",
    # One API asks for a bound on each reply; this is for models that the library does not know.
    "DEFAULT_ANTHROPIC_CHAT_MAX_TOKENS": "16000",
}
HISTORY = ("role", "content", "tool_calls", "thinking_blocks", "reasoning_content", "provider_specific_fields")


@dataclass(frozen=True, slots=True)
class Call:
    """A tool call as the model wrote it; ``arguments`` should be JSON."""

    id: str
    name: str
    arguments: str


@dataclass(frozen=True, slots=True)
class Reply:
    """The model's reply; ``message`` is the same for the conversation, ``usage`` counts tokens where they are known.

    ``end`` is why it ended in litellm's words (``stop``, ``tool_calls``, ``length``, ``content_filter``).
    """

    text: str
    calls: tuple[Call, ...] = ()
    message: Mapping[str, Any] = field(default_factory=dict)
    usage: Mapping[str, int] = field(default_factory=dict)
    end: str = "stop"


@dataclass(frozen=True, slots=True)
class Refusal:
    """A request that failed; ``status`` as of HTTP where there is one. ``too_long``: the conversation does not fit."""

    text: str
    status: int | None = None
    too_long: bool = False
    wait_seconds: float | None = None

    @property
    def passing(self) -> bool:
        """True when the same request may well succeed a little later."""
        return self.status is None or self.status in (408, 409, 429) or self.status >= 500


class Model(Protocol):
    """Asks a model once."""

    def ask(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        """The reply to a conversation; never raises for what the model's side does."""
        ...


@dataclass(frozen=True, slots=True)
class Request:
    """The settings of every request: the seconds without a byte after which it is given up, and the options."""

    route: Route
    key: str | None
    seconds: float
    web_search: bool = False
    max_tokens: int | None = None
    alive: Callable[[int], None] = lambda _: None
    """Called every five seconds while a reply comes in, with its pieces so far."""


class LiteLLM:
    """A model behind litellm; making one imports the library."""

    def __init__(self, request: Request) -> None:
        for name, value in SETTINGS.items():
            os.environ.setdefault(name, value)
        library: Any = importlib.import_module("litellm")
        self._failures = (
            importlib.import_module("openai").OpenAIError,
            importlib.import_module("httpx").HTTPError,
            ValueError,
        )
        library.suppress_debug_info = True
        library.drop_params = True
        library.telemetry = False
        self._library = library
        self._request = request
        self._options = self._fixed()

    @property
    def input_tokens(self) -> int | None:
        """How many tokens a conversation may have, where the library knows the model."""
        entry = self._library.model_cost.get(self._request.route.model) or {}
        entry = entry or self._library.model_cost.get(self._request.route.model.partition("/")[2]) or {}
        limit = entry.get("max_input_tokens")
        return limit if isinstance(limit, int) else None

    def ask(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        """See `Model.ask`."""
        answer = self._once(messages, tools)
        if isinstance(answer, Refusal) and answer.status == BAD_REQUEST and self._options.pop(SEARCH, None):
            # Some models search, and call tools, and do not do both.
            return self._once(messages, tools)
        return answer

    def _once(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        options = {**self._options, "tools": list(tools)} if tools else self._options
        try:
            stream = self._library.completion(messages=[dict(item) for item in messages], **options)
            try:
                chunks = list(self._watched(stream))
            finally:
                _close(stream)
            whole = self._library.stream_chunk_builder(chunks) if chunks else None
        except self._failures as problem:
            return self._refusal(problem)
        return reply_of(whole, chunks)

    def _fixed(self) -> dict[str, Any]:
        request = self._request
        route = request.route
        options: dict[str, Any] = {
            "model": route.model,
            # Without any some clients refuse to ask, and a server on this machine often wants none.
            "api_key": request.key or (None if route.base_url is None else "none"),
            "timeout": request.seconds,
            "num_retries": 0,
            "max_retries": 0,
            "stream": True,
            "stream_options": {"include_usage": True},
        }
        if route.base_url is not None:
            options["api_base"] = route.base_url
        if request.max_tokens is not None:
            options["max_tokens"] = request.max_tokens
        if request.web_search and self._library.supports_web_search(model=route.model):
            options[SEARCH] = {"search_context_size": "medium"}
        if "anthropic/" in route.model:
            # Each request repeats the whole conversation: unmarked, all of it is paid in full every time.
            places = ({"role": "system"}, {"index": -1})
            options["cache_control_injection_points"] = [{"location": "message", **place} for place in places]
        return options

    def _watched(self, stream: Any) -> Any:
        found = time.monotonic()
        for number, chunk in enumerate(stream, 1):
            if time.monotonic() - found > ALIVE_SECONDS:
                found = time.monotonic()
                self._request.alive(number)
            yield chunk

    def _refusal(self, problem: Exception) -> Refusal:
        status = getattr(problem, "status_code", None)
        headers = getattr(getattr(problem, "response", None), "headers", None) or {}
        wait = str(headers.get("retry-after", ""))
        return Refusal(
            text=_describe(problem),
            status=status if isinstance(status, int) else None,
            too_long=isinstance(problem, self._library.ContextWindowExceededError),
            wait_seconds=float(wait) if wait.isdecimal() else None,
        )


def reply_of(whole: Any, chunks: Sequence[Any]) -> Reply:
    """A streamed reply as a value; an empty one when nothing came."""
    if whole is None or not whole.choices:
        return Reply("", message={"role": "assistant", "content": ""}, usage=_usage(chunks))
    dumped = whole.choices[0].message.model_dump()
    calls = tuple(
        Call(str(item.get("id") or f"call_{place}"), str(_function(item, "name")), str(_function(item, "arguments")))
        for place, item in enumerate(dumped.get("tool_calls") or ())
    )
    message = {name: dumped[name] for name in HISTORY if dumped.get(name)}
    message |= {"role": "assistant", "content": dumped.get("content") or ""}
    return Reply(message["content"], calls, message, _usage(chunks), whole.choices[0].finish_reason or "stop")


def _function(call: Mapping[str, Any], name: str) -> str:
    return (call.get("function") or {}).get(name) or ""


def _usage(chunks: Sequence[Any]) -> dict[str, int]:
    """Tokens of the last piece that reports them; all input is in ``input``, the part from a cache also apart."""
    for chunk in reversed(chunks):
        found = getattr(chunk, "usage", None)
        if found is None:
            continue
        details = getattr(found, "prompt_tokens_details", None)
        counts = {
            "input": getattr(found, "prompt_tokens", None),
            "cached": getattr(details, "cached_tokens", None),
            "output": getattr(found, "completion_tokens", None),
        }
        return {name: value for name, value in counts.items() if isinstance(value, int)}
    return {}


@dataclass(frozen=True, slots=True)
class Patient:
    """A model that is asked again a little later when what failed may pass."""

    model: Model
    backoff_seconds: float = BACKOFF_SECONDS
    failed: Callable[[Refusal, bool], None] | None = None
    """Gets the failure, and whether it is the last word."""
    sleep: Callable[[float], None] = time.sleep

    def ask(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        """See `Model.ask`."""
        tried = 0
        while True:
            answer = self.model.ask(messages, tools)
            if isinstance(answer, Reply) or answer.too_long:
                return answer
            last = tried == RETRIES or not answer.passing
            if self.failed is not None:
                self.failed(answer, last)
            if last:
                return answer
            wait = self.backoff_seconds * 3**tried
            self.sleep(min(max(wait, answer.wait_seconds or 0.0), MAX_BACKOFF_SECONDS))
            tried += 1


def size_of(messages: Sequence[Mapping[str, Any]]) -> int:
    """Bytes of a conversation as it is sent."""
    return len(json.dumps(messages, ensure_ascii=False).encode("utf-8", "replace"))


def _describe(problem: BaseException) -> str:
    """The text of a failure and of its first cause: the library's own text may be no more than ``Connection error``."""
    text, root = str(problem) or type(problem).__name__, problem
    for _ in range(MAX_CAUSES):
        if (cause := root.__cause__ or root.__context__) is None:
            break
        root = cause
    return text if str(root) in text else f"{text} ({root})"


def _close(stream: Any) -> None:
    """Give the connection of a stream back; read to its last word, a stream is not yet at the end of its connection.

    Left to the garbage collector it might be closed within the next request, under the very lock that closing needs: a
    wait without an end. The library's own wrapper cannot be closed, so it is what it reads from.
    """
    source = getattr(stream, "completion_stream", None)
    for reader in (getattr(source, "streaming_response", None), source):
        close = getattr(reader, "close", None)
        if close is not None:
            close()
