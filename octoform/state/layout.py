"""Where everything of one host lies: what git keeps and what stays on the machine.

One place for paths, so that no other module joins strings: ``state/<host>/`` is committed (kinds),
``.octoform/<host>/`` is git-ignored and private (instances, attempts, logs, environments).
"""

from functools import cached_property
from pathlib import Path

from octoform.records import dataclass

STAGES = ("probe", "identify", "interface", "serve", "deploy")
OUTPUT_NAMES = {"serve": "server.py"}
STEP = "step."
STEPS = "steps"
UNATTENDED = "unattended.json"
_ON_THE_WAY = ("adopting.json", "former-server.py", "state.json.backup", UNATTENDED)
"""The files by which a killed run is finished or rolled back."""
_MEMORY = (
    "asks.json",
    "breakers.json",
    "claims.json",
    "episodes.jsonl",
    "readings.jsonl",
    "recall.json",
    "report.json",
    "spend.json",
    "starts.json",
)


def is_left(layout: "Layout") -> bool:
    """Whether a run is under way, or was killed, that has put something in service which is not accepted yet."""
    return any((layout.local / name).exists() for name in ("candidate", "adopting.json", UNATTENDED))


@dataclass(frozen=True)
class Layout:
    """All paths of one host below a project folder (the folder of octopus.yaml, absolute)."""

    project: Path
    host: str

    @cached_property
    def committed(self) -> Path:
        """``state/<host>``: what git keeps."""
        return self.project / "state" / self.host

    @cached_property
    def local(self) -> Path:
        """``.octoform/<host>``, mode 0700: what never leaves the machine."""
        return self.project / ".octoform" / self.host

    @property
    def snapshot(self) -> Path:
        """The state file."""
        return self.committed / "state.json"

    @property
    def journal(self) -> Path:
        """The write-ahead journal, one JSON object a line."""
        return self.local / "journal.jsonl"

    @property
    def lock(self) -> Path:
        """The lock of this host's state."""
        return self.local / "lock.json"

    @property
    def instances(self) -> Path:
        """Device id to instance (serial numbers, ports, nodes); read by the runtime at call time."""
        return self.local / "instances.json"

    @property
    def fingerprint(self) -> Path:
        """The kernel's devices when PROBE was last accepted; by them a plan lists what came and went."""
        return self.local / "fingerprint.json"

    @property
    def attempts(self) -> Path:
        """One folder for each attempt of an agent."""
        return self.local / "attempts"

    @property
    def spec_edits(self) -> Path:
        """Agents' edits of their specs, waiting for a person."""
        return self.local / "specs"

    def spec_edit(self, stage: str) -> Path:
        """An agent's edit of a stage's spec in the last run that edited it."""
        return self.spec_edits / f"{stage}.json"

    def records(self) -> tuple[Path, ...]:
        """The files beside the folders that octoform alone writes, and not while an agent runs."""
        names = ("instances.json", "fingerprint.json", "pseudonym.key", "journal.jsonl", "lock.json", "forbidden.json")
        return (*(self.local / name for name in (*names, *_ON_THE_WAY)), self.project / ".octoform" / "compiled.json")

    def memory(self) -> tuple[Path, ...]:
        """The files that the daemon alone writes and goes on from; what a person asks of it lies beside them."""
        return tuple(self.daemon / name for name in _MEMORY)

    @property
    def environments(self) -> Path:
        """Serving environments, one for each lock digest."""
        return self.local / "environments"

    @property
    def endpoint(self) -> Path:
        """Launcher, connection descriptor and client snippets."""
        return self.local / "endpoint"

    @property
    def call_log(self) -> Path:
        """The one execution log of the host: every tool call and every step of a run, one JSON object a line."""
        return self.local / "log" / "octoform.jsonl"

    @property
    def run(self) -> Path:
        """The files of the running endpoint: its sockets, its record, tokens, counters, latches; mode 0700."""
        return self.local / "run"

    @property
    def socket(self) -> Path:
        """Where the endpoint takes the clients of this machine."""
        return self.run / "endpoint.sock"

    @property
    def logs(self) -> Path:
        """The folder of all logs of this host."""
        return self.call_log.parent

    @property
    def server_log(self) -> Path:
        """The output of the endpoint's process."""
        return self.logs / "server.log"

    @property
    def frames(self) -> Path:
        """The last pictures of the host's camera and what is known of them; mode 0700, never in git."""
        return self.local / "frames"

    @property
    def daemon(self) -> Path:
        """The daemon's files: its record, incidents, breakers, readings, claims, health; mode 0700."""
        return self.local / "daemon"

    @property
    def daemon_lock(self) -> Path:
        """The kernel's lock on this file states that a daemon lives; its text names the last one that took it."""
        return self.daemon / "daemon.lock"

    @property
    def restrictions(self) -> Path:
        """The restrictions of claims; written for the endpoint, which releases each at its end."""
        return self.run / "restrictions.json"

    @property
    def forbidden(self) -> Path:
        """Which permanent restrictions there are, in a third place: so that the loss of both others is noticed."""
        return self.local / "forbidden.json"

    @property
    def stop_mark(self) -> Path:
        """There while a person wants the endpoint stopped, so that nothing starts it again by itself."""
        return self.run / "stopped.json"

    @property
    def kept(self) -> Path:
        """Copies of the accepted files by their digests, from which a damaged one is restored."""
        return self.local / "kept"

    @property
    def steps(self) -> Path:
        """The accepted artifacts of the privileged steps, a folder for each."""
        return self.committed / STEPS

    def folder(self, stage: str) -> Path:
        """Where the files of a stage or of a step (``step.arm``) lie."""
        return self.steps / stage.removeprefix(STEP) if stage.startswith(STEP) else self.committed / stage

    def output(self, stage: str) -> Path:
        """The accepted artifact of a stage or of a step (``step.arm``)."""
        return self.folder(stage) / OUTPUT_NAMES.get(stage, "output.json")

    @property
    def runtime(self) -> Path:
        """The standard-library modules beside the generated server."""
        return self.committed / "serve" / "runtime"

    @property
    def requirements_lock(self) -> Path:
        """The full dependency set of the endpoint, exact versions and hashes (pip's requirements format)."""
        return self.committed / "deploy" / "requirements.txt"
