"""A project folder for a test: a manifest, a scripted agent, and the real command line as a user would run it."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import warm
from bench_host import bench_host

OCTOFORM = Path(sys.executable).parent / "octoform"
AGENT = Path(__file__).parents[1] / "agent" / "agent.py"
SHIPPED = Path(__file__).parents[2] / "protocol"
SECONDS = 120.0


@dataclass(frozen=True)
class Done:
    """A command that ended."""

    status: int
    out: str
    err: str

    @property
    def text(self) -> str:
        return self.out + self.err

    def events(self) -> list[dict[str, Any]]:
        """The lines of a ``--json`` stream."""
        return [json.loads(line) for line in self.out.splitlines()]

    def codes(self) -> list[str]:
        """The codes of the diagnostics in a ``--json`` stream, attempts included."""
        found = []
        for event in self.events():
            listed = [event["diagnostic"]] if "diagnostic" in event else event.get("diagnostics", [])
            found += [item["code"] for item in listed]
        return found


@dataclass
class Project:
    """A folder with octopus.yaml whose agent follows a script; the script lies outside of it.

    ``environ`` is added to the environment of octoform, ``env`` names the variables that the agent is given,
    ``prefix`` is a command that runs octoform, ``user`` one that makes it another user's, ``host`` the host's name,
    ``harness`` the manifest's harness in place of the scripted agent. A command may take ``seconds``. The serving
    environment, whose building costs as much as all the rest of an apply, is that of all such projects of the run,
    unless the test has to do with it (``own_environments``). Where it has not to do with what a command starts for
    itself, ``kept_servers`` leaves that to the command after it.
    """

    shared_environments: ClassVar[Path | None] = None

    folder: Path
    outside: Path
    script: dict[str, list[object]] = field(default_factory=dict)
    manifest: dict[str, str] = field(default_factory=dict)
    environ: dict[str, str] = field(default_factory=dict)
    env: list[str] = field(default_factory=list)
    prefix: list[str] = field(default_factory=list)
    host: str = "bench"
    harness: str | None = None
    seconds: float = SECONDS
    own_environments: bool = False
    kept_servers: bool = False
    user: list[str] = field(default_factory=list)

    @property
    def state(self) -> Path:
        return self.folder / "state" / self.host

    @property
    def local(self) -> Path:
        return self.folder / ".octoform" / self.host

    def write(self) -> None:
        """Write manifest and script as they are now."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self.outside.mkdir(parents=True, exist_ok=True)
        if self.harness is None and not self.own_environments and self.shared_environments is not None:
            self.share_environments(self.shared_environments)
        (self.outside / "script.json").write_text(json.dumps(self.script))
        lines = ["version: 1", f"host: {self.host}", f"harness: {self.harness or self.scripted()}"]
        # A test calls as a program does, which cannot be asked anything.
        lines += [f"{key}: {value}" for key, value in {"policy": "{actuate: allow}", **self.manifest}.items()]
        (self.folder / "octopus.yaml").write_text("\n".join(lines) + "\n")

    def scripted(self) -> str:
        """The scripted agent as a harness of the manifest."""
        command = json.dumps([sys.executable, str(AGENT), str(self.outside / "script.json")])
        passed = f", env: {json.dumps(self.env)}" if self.env else ""
        # It writes its log beside its script, which no sandbox would let it do.
        return f"{{name: command, command: {command}{passed}, sandbox: false}}"

    def environment(self) -> dict[str, str]:
        # What the scripted agent writes is held against a host; it is about this one.
        host = {} if self.harness else {"OCTOFORM_SYSROOT": str(bench_host(self.outside / "host"))}
        kept = ("PATH", "HOME", "LANG", "UV_CACHE_DIR", "UV_CONSTRAINT", "SSL_CERT_FILE", "PIP_CERT", "PIP_CONFIG_FILE")
        return {**{name: os.environ[name] for name in kept if name in os.environ}, **host, **self.environ}

    def start(self, *arguments: str, **options: Any) -> "subprocess.Popen[str]":
        """Start octoform and leave it running."""
        return subprocess.Popen(
            [*self.prefix, *self.user, str(OCTOFORM), *arguments],
            cwd=self.folder,
            env=self.environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            **options,
        )

    def run(self, *arguments: str, status: int | None = None) -> Done:
        """Run octoform to its end; ``status`` is what it must leave with."""
        if self.prefix:
            command = [*self.prefix, *self.user, str(OCTOFORM), *arguments]
            ended = subprocess.run(
                command,
                cwd=self.folder,
                env=self.environment(),
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=self.seconds,
            )
            done = Done(ended.returncode, ended.stdout, ended.stderr)
        else:
            environ, kept = self.environment(), self.kept_servers
            ran = warm.run(OCTOFORM, arguments, self.folder, environ, self.seconds, prefix=self.user, kept=kept)
            done = Done(*ran)
        assert "Traceback" not in done.text, done.text
        assert status is None or done.status == status, done.text
        return done

    def apply(self, *arguments: str, status: int | None = None) -> Done:
        """``apply -auto-approve --json`` with the manifest and script as they are now."""
        self.write()
        return self.run("apply", "-auto-approve", "--json", *arguments, status=status)

    def agent_runs(self) -> list[dict[str, Any]]:
        """Every call of the scripted agent so far."""
        log = self.outside / "script.log"
        return [json.loads(line) for line in log.read_text().splitlines()] if log.exists() else []

    def nodes(self) -> dict[str, Any]:
        """The nodes of the state file."""
        nodes: dict[str, Any] = json.loads((self.state / "state.json").read_text())["nodes"]
        return nodes

    def attempts(self, stage: str) -> Sequence[Path]:
        """The attempt folders of a stage, oldest first."""
        return sorted(self.local.glob(f"attempts/*-{stage}-*"))

    def stages_run(self) -> list[str]:
        """The stages of all calls of the scripted agent so far."""
        return [run["stage"] for run in self.agent_runs()]

    def wait_for_agent(self, count: int = 1) -> int:
        """Wait until the agent was started ``count`` times; the process id of the last."""
        deadline = time.monotonic() + 60
        while len(self.agent_runs()) < count:
            assert time.monotonic() < deadline, "no agent was started"
            time.sleep(0.02)
        return int(self.agent_runs()[count - 1]["pid"])

    def share_environments(self, folder: Path) -> None:
        """Keep serving environments in a folder that other projects have too: those of equal packages are one."""
        link = self.local / "environments"
        if not link.exists():
            self.local.mkdir(parents=True, exist_ok=True)
            link.symlink_to(folder)

    def take_environments(self, folder: Path, *, linked: bool = True) -> None:
        """Begin with copies of environments as if they had been built here, in a folder of the project's own.

        For tests that copy, spoil or destroy theirs and prove something else than the building; what is not ``linked``
        may be given to another owner. From then on the environments are this project's own.
        """
        self.local.mkdir(parents=True, exist_ok=True)
        own = self.local / "environments"
        if own.is_symlink():
            own.unlink()
        subprocess.run(["cp", "-al" if linked else "-a", str(folder), str(own)], check=True)

    def take_bytecode(self, folder: Path) -> None:
        """Build own environments, but compile none of the packages that those in a folder have.

        For tests of projects whose packages are their own. The bytecode is moved to the first of them, so it comes from
        copies, which are dropped as every environment without an endpoint is, and may be given to another owner.
        """
        self._donors(folder, "-a")

    @contextmanager
    def borrowed_bytecode(self, folder: Path) -> Iterator[None]:
        """The same for the block alone, where environments of its own are there already."""
        donors = self._donors(folder, "-al")
        try:
            yield
        finally:
            for donor in donors:
                shutil.rmtree(donor, ignore_errors=True)

    def _donors(self, folder: Path, how: str) -> list[Path]:
        own = self.local / "environments"
        own.mkdir(mode=0o700, parents=True, exist_ok=True)
        found = [path for path in folder.iterdir() if path.is_dir() and not (own / path.name).exists()]
        for path in found:
            subprocess.run(["cp", how, str(path), str(own)], check=True)
        return [own / path.name for path in found]

    def own_specs(self) -> Path:
        """Give the project its own copies of the shipped specs; the folder."""
        folder = self.folder / "protocol"
        shutil.copytree(SHIPPED, folder)
        return folder
