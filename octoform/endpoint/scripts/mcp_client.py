"""A real MCP client for one errand: start the launcher, list its tools, call some, tell all of it.

Run as ``python -I mcp_client.py`` with one JSON object on stdin::

    {"command": ["..."], "mode": "auto" | "legacy", "start_seconds": 30.0, "calls":
     [{"tool": "...", "arguments": {}, "seconds": 15.0, "again": 2}]}

One JSON object on stdout: ``{"answered", "error", "protocol", "server", "tools", "calls"}``; each call is
``{"tool", "arguments", "is_error", "problem", "field", "refused", "message", "structured", "pictures", "ms", "again"}``
where ``problem`` is null, ``unknown_tool``, ``bad_argument``, ``timeout``, ``output_schema`` or ``protocol``,
``refused`` is the gate's code when it did not let the tool begin, and ``again`` are the results of its repetitions.
"""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

PASSED = ("HOME", "LOGNAME", "PATH", "SHELL", "TERM", "USER")
"""What the SDK's clients hand to a stdio server: a tool that needs more would fail in a real client too."""
MARK = "OCTOFORM_RUN"
"""Lets the caller find whatever is left running."""


def main() -> None:
    """Load, read the task, start the server, talk to it, print the report."""
    # Before the task is read: whoever sends this client starts the server meanwhile, which takes as long.
    sys.path.insert(0, str(Path(__file__).resolve().parent))
    import anyio
    from conversation import errand

    task: dict[str, Any] = json.load(sys.stdin)
    environment = {name: os.environ[name] for name in (*PASSED, MARK) if name in os.environ}
    process = subprocess.Popen(
        task["command"], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    json.dump(anyio.run(errand, task, process), sys.stdout)


if __name__ == "__main__":
    main()
