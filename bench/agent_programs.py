"""Five stages with each agent program, its model scripted on loopback. (python bench/agent_programs.py [NAME ...])

The model asks at once for the one command that does the stage's work (the embedded agent), so what is measured is the
program itself and what octoform adds to it. Programs that are not installed are named and left out; not part of
`make bench`, which needs nothing but octoform.
"""

import json
import sys
import time
from typing import Any

from measuring import ROOT, SUPPORT, Row, report, scratch
from subjects import inside

sys.path[:0] = [str(SUPPORT), str(ROOT / "tests" / "harness")]
PROGRAMS = ("pi", "opencode", "claude-code", "codex", "gemini-cli", "qwen-code", "litellm")
MODELS = {"claude-code": "anthropic/scripted", "gemini-cli": "gemini/scripted"}
KEY = "LOOP_KEY"


def run(name: str) -> dict[str, Any] | None:
    """The report of an apply from an empty folder, with wall seconds and what the model was asked; None: not there."""
    from agent_runs import SECRET, environment, harness, spec_for
    from model_server import serve

    work = f'{sys.executable} -I -m octoform.builtin "$OCTOFORM_TASK"'
    with serve({"turns": [{"shell": work}, {"text": "done"}]}) as server, scratch() as folder:
        try:
            harness(spec_for(name, server))
        except AssertionError:
            return None
        project = folder / "project"
        project.mkdir()
        settings = {"name": name, "key": KEY, "base_url": server.url}
        manifest = {"version": 1, "host": "bench", "harness": settings, "model": MODELS.get(name, "openai/scripted")}
        (project / "octopus.yaml").write_text(json.dumps(manifest))
        began = time.monotonic()
        found = inside(project, "apply", "-auto-approve", environ={**environment(), KEY: SECRET})
        found["wall"] = time.monotonic() - began
        found["first_request"] = len(json.dumps(server.replies[0]["body"]))
        found["requests"] = len(server.replies)
        return found


def main(names: list[str]) -> int:
    """Measure and print; there is no bound, the programs are other people's."""
    for name in names or PROGRAMS:
        found = run(name)
        if found is None:
            print(f"{name}: not installed; octoform install {name}\n")
            continue
        rows = [
            Row("octoform's own share", found["own"] + found["supervisors"], note=f"{found['agents']} agent runs"),
            Row("the program and its commands", found["phases"]["agent"]),
            Row("from an empty folder to a live endpoint", found["wall"], "s wall"),
            Row("requests to the model", found["requests"], ""),
            Row("its first request", found["first_request"], "bytes"),
        ]
        report(name, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
