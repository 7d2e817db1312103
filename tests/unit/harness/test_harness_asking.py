"""Asking a model: its name and place in litellm's words, what comes back over each API, and what is tried again."""

import gc
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pytest
from model_server import ModelServer, serve

from octoform.diagnostics import Diagnostic
from octoform.harness.llm.client import RETRIES, LiteLLM, Patient, Refusal, Reply, Request
from octoform.harness.llm.route import Route, route
from octoform.harness.react.agent_tools import declared
from octoform.harness.react.chat_history import Conversation
from octoform.manifest.model import HarnessSpec

HERE = "http://127.0.0.1:8080"
KEY = "loop-4e1b77"
SEARCHING = "anthropic/claude-sonnet-4-5-20250929"
STYLES = ("openai/scripted", "anthropic/scripted", "gemini/scripted", "openrouter/maker/scripted", "ollama/scripted")
PATHS = {
    "openai": "/v1/chat/completions",
    "anthropic": "/v1/messages",
    "gemini": "/v1beta/models/scripted:streamGenerateContent",
    "openrouter": "/v1/chat/completions",
    "ollama": "/api/chat",
}


@pytest.mark.parametrize(
    ("model", "settings", "expected"),
    [
        ("openai/m", {}, Route("openai/m", "https://api.openai.com/v1", "OPENAI_API_KEY")),
        ("m", {}, Route("openai/m", "https://api.openai.com/v1", "OPENAI_API_KEY")),
        ("anthropic/m", {}, Route("anthropic/m", "https://api.anthropic.com", "ANTHROPIC_API_KEY")),
        ("google/m", {}, Route("gemini/m", "https://generativelanguage.googleapis.com/v1beta", "GEMINI_API_KEY")),
        ("openrouter/a/m", {}, Route("openrouter/a/m", "https://openrouter.ai/api/v1", "OPENROUTER_API_KEY")),
        ("ollama/m", {}, Route("ollama_chat/m", "http://127.0.0.1:11434", None)),
        ("deepseek/m", {}, Route("deepseek/m", "https://api.deepseek.com/v1", "DEEPSEEK_API_KEY")),
        ("elsewhere/m", {"key": "OTHER"}, Route("elsewhere/m", None, "OTHER")),
        ("elsewhere/m", {"base_url": HERE}, Route("openai/elsewhere/m", f"{HERE}/v1", None)),
        ("openai/m", {"base_url": f"{HERE}/v1/"}, Route("openai/m", f"{HERE}/v1", None)),
        ("anthropic/m", {"base_url": f"{HERE}/v1"}, Route("anthropic/m", HERE, None)),
        ("gemini/m", {"base_url": HERE}, Route("gemini/m", f"{HERE}/v1beta", None)),
        ("ollama_chat/m", {"base_url": HERE, "key": "K"}, Route("ollama_chat/m", HERE, "K")),
        ("anthropic/m", {"base_url": HERE, "api": "openai-completions"}, Route("openai/m", f"{HERE}/v1", None)),
        ("openai/m", {"base_url": HERE, "api": "anthropic-messages", "key": "K"}, Route("anthropic/m", HERE, "K")),
    ],
)  # fmt: skip
def test_a_model_in_the_words_of_litellm(model: str, settings: dict[str, Any], expected: Route) -> None:
    assert route(HarnessSpec("litellm", **settings), model, {}) == expected


def test_what_cannot_be_asked() -> None:
    for spec, model in ((HarnessSpec("litellm"), None), (HarnessSpec("litellm", api="openai-responses"), "openai/m")):
        assert isinstance(route(spec, model, {}), Diagnostic)


@pytest.fixture(scope="module")
def _imported() -> None:
    """litellm, once: it takes seconds."""
    LiteLLM(Request(Route("openai/m", HERE, None), "k", 5.0))


def client(server: ModelServer | str, model: str = "openai/scripted", **settings: Any) -> LiteLLM:
    url = server if isinstance(server, str) else server.url
    way = route(HarnessSpec("litellm", base_url=url), model, {})
    assert isinstance(way, Route)
    return LiteLLM(Request(way, KEY, settings.pop("seconds", 20.0), **settings))


@pytest.mark.usefixtures("_imported")
@pytest.mark.filterwarnings("ignore:Accessing the")
class TestOverEachApi:
    """With the library itself."""

    @pytest.mark.parametrize("model", STYLES)
    def test_a_conversation_with_a_call(self, model: str) -> None:
        script = {
            "turns": [{"shell": "echo hi", "text": "I look."}, {"text": "done"}],
            "usage": {"input": 1000, "cached": 400, "output": 50},
        }
        conversation = Conversation("Instructions.", "Task.")
        with serve(script) as server:
            asker = client(server, model)
            reply = asker.ask(conversation.messages(), declared())
            assert isinstance(reply, Reply), reply
            conversation.replied(reply)
            conversation.returned(reply.calls[0].id, reply.calls[0].name, "hi")
            last = asker.ask(conversation.messages(), declared())
            asked = server.replies
        assert (reply.text, reply.calls[0].name, reply.calls[0].arguments) == (
            "I look.",
            "shell",
            '{"command": "echo hi"}',
        )
        cached = {} if model.startswith("ollama") else {"cached": 400}
        assert reply.usage == {"input": 1000, **cached, "output": 50}
        assert isinstance(last, Reply) and (last.text, last.calls) == ("done", ())
        assert [item["path"].partition("?")[0] for item in asked] == [PATHS[model.partition("/")[0]]] * 2
        assert {item["key"] for item in asked} == {KEY}
        assert all(item["stream"] for item in asked)

    @pytest.mark.parametrize("model", STYLES)
    @pytest.mark.parametrize(
        ("turn", "status", "passing"),
        [
            ({"status": 401}, 401, False),
            ({"status": 429, "headers": {"retry-after": "7"}}, 429, True),
            ({"status": 500}, 500, True),
            ({"text": "half of it is lost " * 20, "drop": "mid"}, 500, True),
            ({"drop": "head"}, 500, True),
        ],
    )
    def test_a_failure_keeps_its_status_and_is_asked_once(
        self, model: str, turn: dict[str, Any], status: int, passing: bool
    ) -> None:
        with serve([turn]) as server:
            answer = client(server, model).ask([{"role": "user", "content": "x"}], declared())
            assert len(server.replies) == 1
        assert isinstance(answer, Refusal)
        assert (answer.status, answer.passing, answer.too_long) == (status, passing, False)
        assert KEY not in answer.text

    def test_nobody_listens(self) -> None:
        answer = client("http://127.0.0.1:9").ask([{"role": "user", "content": "x"}], ())
        assert isinstance(answer, Refusal) and answer.passing

    def test_a_reply_that_stalls_is_given_up(self) -> None:
        with serve([{"text": "and then nothing", "stall": 600}]) as server:
            answer = client(server, seconds=0.5).ask([{"role": "user", "content": "x"}], declared())
        assert isinstance(answer, Refusal) and answer.passing

    def test_a_provider_that_nobody_knows(self) -> None:
        asker = LiteLLM(Request(Route("elsewhere/m", None, None), "k", 5.0))
        answer = asker.ask([{"role": "user", "content": "x"}], ())
        assert isinstance(answer, Refusal) and not answer.passing

    def test_the_cap_is_part_of_the_request(self) -> None:
        with serve({"turns": [{"text": "short"}], "side": False}) as server:
            client(server, max_tokens=77).ask([{"role": "user", "content": "x"}], ())
            client(server, "anthropic/scripted", max_tokens=78).ask([{"role": "user", "content": "x"}], ())
            client(server, "anthropic/scripted").ask([{"role": "user", "content": "x"}], ())
            assert [item["body"]["max_tokens"] for item in server.replies] == [77, 78, 16000]

    def test_web_search_only_where_it_is_wanted_and_known_to_be_there(self) -> None:
        with serve([{"text": "done"}]) as server:
            for model, wanted in ((SEARCHING, True), (SEARCHING, False), ("anthropic/scripted", True)):
                client(server, model, web_search=wanted).ask([{"role": "user", "content": "x"}], declared())
            offered = [item["tools"] for item in server.replies]
        assert ["web_search" in names for names in offered] == [True, False, False]
        assert all("shell" in names for names in offered)

    def test_a_model_that_cannot_search_and_call_tools_calls_tools(self) -> None:
        with serve([{"text": "done", "fail_first": [{"status": 400}]}]) as server:
            asker = client(server, SEARCHING, web_search=True)
            for _ in range(2):
                assert isinstance(asker.ask([{"role": "user", "content": "x"}], declared()), Reply)
            offered = [item["tools"] for item in server.replies]
        assert ["web_search" in names for names in offered] == [True, False, False]

    @pytest.mark.parametrize("model", ["openai/scripted", "anthropic/scripted"])
    def test_no_connection_is_left_for_the_garbage_collector(self, model: str) -> None:
        """It would close it at any moment, also under the lock of the pool, which the same thread then waits for."""
        with serve([{"text": "done"}, {"status": 400}]) as server:
            asker = client(server, model)
            for _ in range(3):
                asker.ask([{"role": "user", "content": "x"}], declared())
                streams = [item for item in gc.get_objects() if type(item).__name__ == "PoolByteStream"]
                assert [item for item in streams if not item._closed] == []

    def test_what_is_repeated_is_marked_for_the_cache(self) -> None:
        messages = Conversation("Instructions.", "Task.").messages()
        with serve([{"text": "done"}]) as server:
            client(server, "anthropic/scripted").ask(messages, declared())
            body = server.replies[0]["body"]
        assert body["system"][0]["cache_control"] == {"type": "ephemeral"}
        assert body["messages"][-1]["content"][-1]["cache_control"] == {"type": "ephemeral"}
        assert [set(item) for item in messages] == [{"role", "content"}] * 2, "the conversation itself stays as it is"

    def test_how_much_a_known_model_takes(self) -> None:
        assert client(HERE, "anthropic/claude-sonnet-4-5").input_tokens == 200_000
        assert client(HERE, "anthropic/scripted").input_tokens is None


class Answers:
    """A model that answers in order, and what was waited between."""

    def __init__(self, *answers: Reply | Refusal) -> None:
        self.answers: Iterator[Reply | Refusal] = iter(answers)
        self.waited: list[float] = []
        self.failed: list[tuple[int | None, bool]] = []

    def ask(self, messages: Sequence[Mapping[str, Any]], tools: Sequence[Mapping[str, Any]]) -> Reply | Refusal:
        return next(self.answers)

    def patiently(self) -> Reply | Refusal:
        def failed(refusal: Refusal, last: bool) -> None:
            self.failed.append((refusal.status, last))

        return Patient(self, 1.0, failed, self.waited.append).ask((), ())


def test_what_may_pass_is_tried_again_a_little_later() -> None:
    model = Answers(Refusal("x", 500), Refusal("x", 429, wait_seconds=7.0), Reply("ok"))
    assert model.patiently() == Reply("ok")
    assert model.waited == [1.0, 7.0]
    assert model.failed == [(500, False), (429, False)]


@pytest.mark.parametrize("status", [None, 408, 429, 500, 503, 529])
def test_it_is_not_tried_for_ever(status: int | None) -> None:
    model = Answers(*[Refusal("x", status)] * (RETRIES + 1))
    assert model.patiently() == Refusal("x", status)
    assert model.waited == [1.0, 3.0]
    assert [last for _, last in model.failed] == [False, False, True]


@pytest.mark.parametrize("status", [400, 401, 403, 404, 422])
def test_what_will_not_pass_is_not_tried_again(status: int) -> None:
    model = Answers(Refusal("x", status))
    assert model.patiently() == Refusal("x", status)
    assert (model.waited, model.failed) == ([], [(status, True)])


def test_a_server_that_says_to_wait_very_long_is_not_obeyed() -> None:
    model = Answers(Refusal("x", 429, wait_seconds=3600.0), Reply("ok"))
    model.patiently()
    assert model.waited == [20.0]


def test_too_long_is_for_the_conversation_to_mend() -> None:
    model = Answers(Refusal("x", 400, too_long=True))
    assert isinstance(model.patiently(), Refusal)
    assert model.failed == []
