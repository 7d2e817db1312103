"""Housekeeping: a bare completion condenses a long log for the retry; without one the end of the log serves as well."""

import pytest
from model_server import serve
from projects import Project

SUMMARY = "WHAT FAILED: the identifiers were quoted from memory.\nWHAT TO DO: quote them from the file."
KEY = "sk-of-the-housekeeper-0123456789"


@pytest.fixture
def talkative(project: Project) -> Project:
    """The first attempt prints far more than a prompt may hold, and fails."""
    project.script = {"probe": [{"say": "line of noise\n" * 20_000, "exit": 3}, "good"]}
    project.environ = {"HOUSE_KEY": KEY}
    return project


def housekeeping(project: Project, url: str) -> None:
    project.manifest["housekeeping"] = f"{{model: openai/small, max_tokens: 200, key: HOUSE_KEY, base_url: '{url}'}}"
    project.manifest["prices"] = "{openai/small: {input: 1, output: 10}}"


def test_a_long_log_is_condensed_and_stays_as_it_is(talkative: Project) -> None:
    script = {"turns": [{"text": SUMMARY}], "side": False, "usage": {"input": 12_000, "output": 40, "cached": 0}}
    with serve(script) as server:
        housekeeping(talkative, server.url)
        done = talkative.apply("-target", "probe", status=0)
        asked = [request for request in server.requests if request.get("api") == "chat"]
    assert len(asked) == 1, "one request, no tools"
    assert asked[0]["tools"] == []
    first, second = talkative.attempts("probe")
    prompt = (second / "prompt.md").read_text()
    assert "quoted from memory" in prompt and "# A summary of its log" in prompt
    assert "line of noise" not in prompt.partition("# A summary of its log")[2]
    assert (first / "agent.log").stat().st_size > 250_000, "the evidence is whole"
    usage = talkative.nodes()["probe"]["usage"]
    assert (usage["input_tokens"], usage["output_tokens"]) == (12_000, 40)
    assert KEY not in done.text and KEY not in prompt


def test_without_a_summary_the_end_of_the_log_is_told(talkative: Project) -> None:
    """Here for want of a key; the others of its reasons are tried at the completion and at the condensing."""
    talkative.environ.clear()
    housekeeping(talkative, "http://127.0.0.1:9")
    done = talkative.apply("-target", "probe", status=0)
    prompt = (talkative.attempts("probe")[1] / "prompt.md").read_text()
    assert "line of noise" in prompt and "# The end of its log" in prompt
    assert len(prompt) < 24 * 1024
    assert any("the log is not condensed" in str(event.get("text")) for event in done.events())
