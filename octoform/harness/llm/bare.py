"""One bare question: ``python -I -m octoform.harness.llm.bare``, no tools, no conversation, one reply.

Standard input holds the question as JSON, {route, text, instruction, max_tokens, seconds, backoff_seconds}; standard
output gets one JSON line, {text, end, usage} or {failed, status}.
"""

import json
import os
import sys
from typing import Any

from octoform.base.files import parse
from octoform.harness.llm.client import LiteLLM, Patient, Refusal, Request
from octoform.harness.llm.route import Route


def main(question: dict[str, Any]) -> dict[str, Any]:
    """Ask it."""
    route = Route(**question["route"])
    key = os.environ.get(route.key) if route.key else None
    model = LiteLLM(Request(route, key, question["seconds"], max_tokens=question["max_tokens"]))
    messages = [
        {"role": "system", "content": question["instruction"]},
        {"role": "user", "content": question["text"]},
    ]
    answer = Patient(model, question["backoff_seconds"]).ask(messages, ())
    if isinstance(answer, Refusal):
        return {"failed": answer.text, "status": answer.status}
    return {"text": answer.text, "end": answer.end, "usage": dict(answer.usage)}


if __name__ == "__main__":
    print(json.dumps(main(parse(sys.stdin.buffer.read()))), flush=True)
    # The libraries' own threads and exit handlers have nothing left to do, and some of them take their time.
    os._exit(0)
