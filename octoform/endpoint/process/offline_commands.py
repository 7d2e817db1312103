"""Runs the launcher's own small programs for what has to work while no process of the endpoint answers.

They are started from octoform's copy of the launcher with octoform's interpreter, so neither a lost serving environment
nor an edited endpoint folder is in the way, and the rules of latch, counters and audit log exist once: the core never
imports the launcher. Light.
"""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse
from octoform.state.layout import Layout

SERVER = Path(__file__).resolve().parents[2] / "server"
SEAL = "audit.head"
"""In the folder of the logs, and in that of what the process keeps, which is the witness."""
SECONDS = 20.0


def ask(layout: Layout, verb: str, asked: Mapping[str, Any]) -> dict[str, Any]:
    """The answer of ``server/offline.py VERB``: ``ok``, ``problems`` and what the verb has.

    When it answers nothing that can be read, ``ok`` is false and ``problems`` states why.
    """
    return run(SERVER / "offline.py", verb, str(layout.endpoint), json.dumps(asked))


def verify(layout: Layout) -> dict[str, Any]:
    """The verdict of ``server/audit/chain.py verify`` on this host's audit log, or ``ok`` false with ``problems``."""
    return run(SERVER / "audit" / "chain.py", "verify", str(layout.logs), str(layout.run / SEAL))


def run(program: Path, *arguments: str) -> dict[str, Any]:
    """One JSON object from a program of the launcher."""
    command = [sys.executable, "-I", "-S", str(program), *arguments]
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=SECONDS, check=False
        )
        answer = parse(done.stdout)
    except subprocess.TimeoutExpired:
        return {"ok": False, "problems": [f"{program.name} was not done after {SECONDS:.0f} s"]}
    except OSError as problem:
        return {"ok": False, "problems": [f"{program.name} could not be started: {problem}"]}
    except ValueError:
        lines = done.stderr.strip().splitlines()
        return {"ok": False, "problems": [lines[-1] if lines else f"{program.name} ended with {done.returncode}"]}
    return answer if isinstance(answer, dict) else {"ok": False, "problems": [f"{program.name} answered nonsense"]}
