"""The bare completion as its own process: capped, bounded in time, with the key by its name, and never an exception."""

import json
import time
from pathlib import Path
from typing import Any

import pytest
from model_server import ModelServer, serve

from octoform.diagnostics import Diagnostic
from octoform.harness.containment.contained_run import Ended
from octoform.harness.llm import bare
from octoform.harness.llm.completion import BYTES_PER_TOKEN, Condensed, LiteLLMCompletion, condense
from octoform.harness.llm.route import Route
from octoform.harness.port import Usage
from octoform.manifest.model import Housekeeping

SECRET = "loop-86a1f0c3"
ENVIRON = {"PATH": "/usr/bin:/bin", "LOOP_KEY": SECRET}
SUMMARY = "WHAT FAILED: no module named wheel\nWHY: not clear from the log"


def script(*turns: dict[str, Any]) -> dict[str, Any]:
    return {"turns": list(turns), "side": False, "usage": {"input": 900, "cached": 100, "output": 30}}


def completion(server: ModelServer | str, **settings: Any) -> LiteLLMCompletion:
    url = server if isinstance(server, str) else server.url
    cap = settings.pop("max_tokens", 200)
    keeper = Housekeeping("openai/scripted", cap, key="LOOP_KEY", base_url=url)
    return LiteLLMCompletion(keeper, ENVIRON, **{"seconds": 60.0, "backoff_seconds": 0.05, **settings})


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """20,000 lines, as a build that went wrong leaves them."""
    path = tmp_path / "task.log"
    path.write_text("".join(f"line {number} of a long build\n" for number in range(20_000)))
    return path


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the process does, done here, where the library is loaded once; the process is that of a whole apply."""
    monkeypatch.setenv("LOOP_KEY", SECRET)

    def ask(_: LiteLLMCompletion, folder: Path, way: Route, question: str) -> tuple[Ended, bytes]:
        return Ended("ended", 0), json.dumps(bare.main(json.loads(question))).encode()

    monkeypatch.setattr(LiteLLMCompletion, "_ask", ask)


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.filterwarnings("ignore:Accessing the")
def test_an_answer_within_the_cap(log: Path) -> None:
    before = log.read_bytes()
    with serve(script({"text": SUMMARY})) as server:
        excerpt = condense(log, 8192, completion(server))
        asked = server.replies
    assert (excerpt.text, excerpt.condensed, excerpt.reason) == (SUMMARY, True, "")
    assert excerpt.usage == Usage(900, 100, 30)
    assert [(item["body"]["max_tokens"], item["key"], item["tools"]) for item in asked] == [(200, SECRET, [])]
    question = asked[0]["body"]["messages"]
    assert [item["role"] for item in question] == ["system", "user"]
    assert "line 0 of" in question[1]["content"] and "line 19999 of" in question[1]["content"]
    assert "text data=log" in question[1]["content"]
    assert len(question[1]["content"]) < 80_000
    assert log.read_bytes() == before


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.filterwarnings("ignore:Accessing the")
def test_a_model_that_cannot_be_reached(log: Path) -> None:
    excerpt = condense(log, 8192, completion("http://127.0.0.1:9"))
    assert not excerpt.condensed
    assert "the model cannot be reached" in excerpt.reason
    assert excerpt.text.endswith("line 19999 of a long build")
    assert len(excerpt.text) <= 8192


@pytest.mark.slow
def test_a_model_that_is_slow(log: Path) -> None:
    with serve(script({"text": SUMMARY, "stall": 600})) as server:
        began = time.monotonic()
        excerpt = condense(log, 8192, completion(server, seconds=2.0))
    assert excerpt.reason == "the housekeeping model gave no answer: no answer within 2 s"
    assert excerpt.text.endswith("line 19999 of a long build")
    assert time.monotonic() - began < 20


@pytest.mark.slow
@pytest.mark.usefixtures("here")
@pytest.mark.filterwarnings("ignore:Accessing the")
def test_a_key_that_is_refused_is_asked_with_once(log: Path) -> None:
    with serve(script({"status": 401})) as server:
        excerpt = condense(log, 8192, completion(server))
        assert len(server.replies) == 1
    assert "the key was refused" in excerpt.reason and SECRET not in excerpt.reason
    assert excerpt.text.endswith("line 19999 of a long build")


def test_a_key_that_is_not_there_is_not_asked_with() -> None:
    keeper = Housekeeping("openai/scripted", 200)
    answer = LiteLLMCompletion(keeper, {"PATH": "/usr/bin:/bin"}).complete("log", "instruction")
    assert isinstance(answer, Diagnostic)
    assert (answer.code, answer.summary) == (
        "HOUSEKEEPING-FAILED",
        "the housekeeping model gave no answer: the variable OPENAI_API_KEY with its key is not set",
    )


@pytest.mark.parametrize(
    ("said", "told"),
    [
        (b"", "its process ended without an answer after 3 s (status 1)"),
        (b"Traceback\n", "its process ended without an answer"),
        (b'{"text": "  ", "end": "content_filter"}\n', "the model answered nothing (it ended with content_filter)"),
        (b'{"failed": "scripted 429", "status": 429}\n', "the model's rate limit is reached: scripted 429"),
        (b'{"failed": "no such model", "status": 404}\n', "the request was refused: no such model"),
    ],
)
def test_what_is_no_answer(said: bytes, told: str) -> None:
    answer = completion("http://127.0.0.1:9")._answer(Ended("ended", 1), said, 3.0)
    assert isinstance(answer, Diagnostic) and told in answer.summary


def test_more_than_the_cap_allows_is_cut() -> None:
    text = b'noise of a library\n{"text": "%s", "end": "stop", "usage": {"output": 9000}}\n' % (b"x" * 9000)
    answer = completion("http://127.0.0.1:9", max_tokens=10)._answer(Ended("ended", 0), text, 3.0)
    assert answer == Condensed("x" * 10 * BYTES_PER_TOKEN, Usage(output_tokens=9000), cut=True)
    short = completion("http://127.0.0.1:9")._answer(Ended("ended", 0), b'{"text": "as far as", "end": "length"}', 3.0)
    assert short == Condensed("as far as", cut=True)
