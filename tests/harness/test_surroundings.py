"""A program has its task and its model, and nothing else: not what lies around the attempt, and no way outside."""

import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace

import pytest
from agent_runs import Ran, spec_for
from harness.matrix import PROGRAMS, Subject
from model_server import serve

from octoform.harness.port import ExitReason, Task

INSTRUCTIONS = ("AGENTS.md", "CLAUDE.md", "GEMINI.md", "QWEN.md", "opencode.json")
PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY", "http_proxy", "https_proxy", "all_proxy")
LOOPBACK = "127.0.0.1,localhost"


@contextmanager
def proxy() -> Iterator[tuple[str, Callable[[], int]]]:
    """A proxy that never answers, and how many have asked it."""
    with socket.create_server(("127.0.0.1", 0), backlog=64) as listening:
        listening.setblocking(False)

        def asked() -> int:
            found = 0
            while True:
                try:
                    listening.accept()[0].close()
                except BlockingIOError:
                    return found
                found += 1

        yield f"http://127.0.0.1:{listening.getsockname()[1]}", asked


@pytest.mark.parametrize("subject", PROGRAMS)
def test_nothing_of_its_surroundings_reaches_the_model_and_nothing_is_looked_up(
    subject: Subject, task_for: Callable[..., Task], run: Callable[..., Ran]
) -> None:
    task = task_for(subject.model)
    # The attempt's own folder holds what octoform put there; everything above it is the project's, or anybody's.
    for name in INSTRUCTIONS:
        (task.workdir.parent / name).write_text('{"instructions": ["walrus"]}\n')
    (task.workdir.parent / ".git").mkdir()
    with serve([{"text": "All is well."}]) as server, proxy() as (url, asked):
        outside = {**dict.fromkeys(PROXIES, url), "NO_PROXY": LOOPBACK, "no_proxy": LOOPBACK}
        spec = spec_for(subject.name, server, api=subject.api, env=tuple(outside))
        ran = run(spec, replace(task, environment={**task.environment, **outside}))
        assert ran.outcome.reason is ExitReason.FINISHED, ran.task.log.read_text()[-4000:]
        text = str([request["body"] for request in server.requests])
        assert asked() == 0
    assert "Grüße" in text
    assert "walrus" not in text
