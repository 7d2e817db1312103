"""The programs that judge an MCP server from outside, pinned, and how to run them.

They are installed like the agent programs, with the node that octoform brings, into the folder that those are in:

    python tests/conformance/suites.py
"""

import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic
from octoform.engine.doctor import _fetch
from octoform.harness.installer import Setup, home_of, install
from octoform.harness.program_location import RECORD, Pin, folder

HANDSHAKE = Pin("@modelcontextprotocol/conformance", "0.1.16", "conformance", (22, 0))
"""The released suite: revision 2025-11-25."""
LATER = Pin("@modelcontextprotocol/conformance", "0.2.0-alpha.12", "conformance", (22, 0))
"""The one that has the requirements of revision 2026-07-28."""
INSPECTOR = Pin("@modelcontextprotocol/inspector", "2.12.0", "mcp-inspector", (22, 19))
SECONDS = 120.0
_STAMP = re.compile(r"-\d{4}-\d\d-\d\dT[\d-]+Z$")


@dataclass(frozen=True)
class Report:
    """What a suite said: its exit status, and the checks of each scenario by their status."""

    status: int
    printed: str
    scenarios: Mapping[str, Mapping[str, int]] = field(default_factory=dict)
    failures: tuple[str, ...] = ()

    def passed(self) -> list[str]:
        """The scenarios without a failed check, by name."""
        return sorted(name for name, checks in self.scenarios.items() if not checks.get("FAILURE"))

    def failed(self) -> list[str]:
        """The others."""
        return sorted(set(self.scenarios) - set(self.passed()))


def missing() -> list[str]:
    """The programs that are not installed."""
    pins = (HANDSHAKE, LATER, INSPECTOR)
    return [f"{pin.package} {pin.version}" for pin in pins if not (home_of(pin, os.environ) / RECORD).exists()]


def judge(pin: Pin, url: str, output: Path, *options: str) -> Report:
    """Run a conformance suite against a server; ``options`` say which scenarios."""
    done = run(pin, "server", "--url", url, "-o", str(output), *options)
    scenarios: dict[str, Mapping[str, int]] = {}
    failures: list[str] = []
    for found in sorted(output.glob("*/checks.json")):
        name = _STAMP.sub("", found.parent.name.removeprefix("server-"))
        checks: list[dict[str, Any]] = json.loads(found.read_text())
        statuses = [str(check["status"]) for check in checks]
        scenarios[name] = {status: statuses.count(status) for status in statuses}
        failures += [
            f"{name}: {check['id']}: {check.get('errorMessage')}" for check in checks if check["status"] == "FAILURE"
        ]
    return Report(done.returncode, done.stdout + done.stderr, scenarios, tuple(failures))


def run(pin: Pin, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Run one of the programs to its end."""
    home = home_of(pin, os.environ)
    record = json.loads((home / RECORD).read_text())
    path = os.pathsep.join(filter(None, (record["node"], os.environ.get("PATH"))))
    environ = os.environ | {"PATH": path, "MCP_INSPECTOR_SECRET_STORE": "memory", "NO_COLOR": "1"}
    program = home / "node_modules" / ".bin" / pin.binary
    return subprocess.run(
        [program, *arguments], env=environ, capture_output=True, text=True, timeout=SECONDS, stdin=subprocess.DEVNULL
    )


def main() -> int:
    """Install what is not there yet; the exit status."""
    setup = Setup(folder(os.environ), os.environ, _fetch, lambda words: print(words, flush=True))
    for pin in (HANDSHAKE, LATER, INSPECTOR):
        done = install(pin, setup)
        if isinstance(done, Diagnostic):
            print(f"{done.summary}\n{done.detail or ''}", file=sys.stderr)
            return 1
        print(f"{pin.package} {pin.version}: {done.home}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
