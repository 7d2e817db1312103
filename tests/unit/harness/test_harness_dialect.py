"""What a failed request means by its words and its status, whichever program reports it."""

import pytest

from octoform.harness.event_parser import problem
from octoform.harness.port import ExitReason

FINAL = (ExitReason.AUTH, ExitReason.REFUSED)


@pytest.mark.parametrize(
    ("status", "text", "reason"),
    [
        (404, "The network of models has no such thing.", ExitReason.REFUSED),
        (402, "Payment is overdue.", ExitReason.REFUSED),
        (400, "Unsupported value: temperature", ExitReason.REFUSED),
        (400, "API key not valid. Please pass a valid API key.", ExitReason.AUTH),
        (400, "invalid max_tokens", ExitReason.REFUSED),
        (400, "prompt is too long: 210000 tokens > 200000 maximum", ExitReason.CRASHED),
        (400, "Your credit balance is too low", ExitReason.REFUSED),
        (429, "You exceeded your current quota, please check your plan and billing details.", ExitReason.RATE_LIMIT),
        (500, "model not found in cache", ExitReason.UNREACHABLE),
        (None, "404 The model `nothing` does not exist", ExitReason.REFUSED),
        (None, "402 status code (no body)", ExitReason.REFUSED),
        (None, "unexpected status 404 Not Found: , url: http://127.0.0.1:4000/v1", ExitReason.REFUSED),
        (None, '{"error":{"code":404,"message":"gone"}}', ExitReason.REFUSED),
        (None, "model 'qwen3' not found", ExitReason.REFUSED),
        (None, "insufficient_quota", ExitReason.REFUSED),
        (None, "connect ECONNREFUSED 127.0.0.1:404", ExitReason.UNREACHABLE),
        (None, "429: 400 requests a minute are the limit", ExitReason.RATE_LIMIT),
        (None, "out of luck", ExitReason.CRASHED),
    ],
)
def test_trouble(status: int | None, text: str, reason: ExitReason) -> None:
    found = problem(text, status)
    assert (found.reason, found.final, found.text) == (reason, reason in FINAL, text)
