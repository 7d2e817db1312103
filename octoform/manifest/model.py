"""The meaning of a manifest as frozen values: the only form of it that the rest of octoform knows.

Light on purpose: a plan with nothing to do must not import the YAML reader or pydantic to talk about a manifest.
References to variables (``${NAME}``) stay unresolved in here, so nothing that is made of a `Manifest` (a key, the
state, a plan, a log) can hold the value of a secret.
"""

from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Span
from octoform.policy.resolve import Policy
from octoform.records import dataclass, field

FILE_NAME = "octopus.yaml"
STAGES = ("probe", "identify", "interface", "serve", "deploy")
KEEPERS = ("watch", "heal")
"""The agents of the daemon: they have settings as stages do, and are no part of the pipeline."""
STEP = "step."
"""How the name of a privileged step's node begins; all steps have the same settings."""
MODEL_FREE = ("builtin", "replay")
"""The harnesses that use no model."""
EVERY_INTERFACE = "all"
FIRST_PORT = 7777
TUNNEL_URL = "{url}"
TUNNEL_COMMAND = ("cloudflared", "tunnel", "--no-autoupdate", "--url", TUNNEL_URL)
# What may be in braces in the arguments of a command, and is filled in for each attempt.
PLACEHOLDERS = ("prompt_file", "task", "output", "workdir", "model", "stage", "prompt")


@dataclass(frozen=True, slots=True)
class Sandbox:
    """Confinement of an agent: it writes only in its attempt's folder; ``network`` states whether it has one.

    One that is not ``required`` is omitted where it cannot be had, which is reported.
    """

    network: bool = True
    required: bool = False


@dataclass(frozen=True, slots=True)
class HarnessSpec:
    """How an agent is run.

    ``command`` is the list of arguments with references and placeholders as written: the whole command of the
    ``command`` harness, the program of a named one where it is not the installed one; else empty. ``env`` are the
    names of the variables that the agent may see. ``key`` is the one with the API key; in a manifest it is final: the
    usual one of the model's provider where none is named, None where none is needed. ``base_url`` is where the model's
    API is, reference unresolved, and ``api`` which one it speaks; None: the provider's own. ``prompt_via`` is
    ``stdin``, ``file`` or ``argument``. ``recording`` is the absolute folder of a recorded run.
    ``login``: the program's owner is logged in, and ``key`` is the variable for the token of that.
    ``sandbox`` None: the agent is not confined.
    """

    name: str
    command: tuple[str, ...] = ()
    env: tuple[str, ...] = ()
    prompt_via: str = "stdin"
    key: str | None = None
    base_url: str | None = None
    api: str | None = None
    web_search: bool = False
    login: bool = False
    sandbox: Sandbox | None = Sandbox()
    recording: Path | None = None


@dataclass(frozen=True, slots=True)
class Budget:
    """The budget of a stage: attempts as a count, times in seconds, ``tools`` as the most tools of the endpoint.

    ``idle_seconds`` without a sign of progress end an attempt (None: as the harness has it by default). ``turns`` are
    replies of the model in one attempt, ``usd`` the US dollars of all attempts of this stage (None: no
    limit of its own). ``edit_specs``: a retry may correct its own copy of the spec.
    """

    attempts: int
    attempt_seconds: float
    stage_seconds: float
    tools: int
    idle_seconds: float | None = None
    turns: int = 100
    usd: float | None = None
    edit_specs: bool = True


@dataclass(frozen=True, slots=True)
class Price:
    """US dollars for a million tokens: fresh input, input from a cache, output."""

    input: float
    cached: float
    output: float


@dataclass(frozen=True, slots=True)
class Escalation:
    """The agent for what the stage's own agent left ``unknown``."""

    harness: HarnessSpec
    model: str | None


@dataclass(frozen=True, slots=True)
class Housekeeping:
    """The bare completion that condenses long logs: its model, and the most tokens that it may answer with.

    ``key`` is final, as in `HarnessSpec`.
    """

    model: str
    max_tokens: int
    key: str | None = None
    base_url: str | None = None


@dataclass(frozen=True, slots=True)
class StageSettings:
    """The settings in force for one stage, after the stage's own settings have been laid over the general ones."""

    harness: HarnessSpec
    model: str | None
    budget: Budget
    escalate: Escalation | None = None


@dataclass(frozen=True, slots=True)
class Lifecycle:
    """``prevent_destroy`` refuses to destroy; ``ignore`` names what may change without making anything again."""

    prevent_destroy: bool = False
    ignore: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Git:
    """``commit`` lets apply commit what it changed."""

    commit: bool = False


@dataclass(frozen=True, slots=True)
class Network:
    """Where the endpoint listens: an interface's name or address, or ``all``, and the first port to try.

    ``hosts`` are more names that clients may call it by, ``origins`` the web pages that may call it from a browser.
    """

    interface: str = EVERY_INTERFACE
    port: int = FIRST_PORT
    hosts: tuple[str, ...] = ()
    origins: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Tunnel:
    """The program that gives the endpoint an address on the internet; ``{url}`` in it is the endpoint's own."""

    command: tuple[str, ...] = TUNNEL_COMMAND


@dataclass(frozen=True, slots=True)
class TypedProfile:
    """A profile that is in the manifest itself: its text is what a file of it would hold.

    ``place`` names it in the manifest; its first line is ``line`` there, indented by ``indent`` columns.
    """

    text: str
    place: str
    line: int
    indent: int


ProfileSource = Path | TypedProfile


@dataclass(frozen=True, slots=True)
class Perception:
    """Looking through a camera: whether octoform does it by itself, through which (None: the best), every how long.

    ``camera`` is a device id, ``interval`` is in seconds.
    """

    enabled: bool = False
    camera: str | None = None
    interval: float = 300


@dataclass(frozen=True, slots=True)
class Notify:
    """The receivers of alerts about incidents.

    ``command`` gets it as JSON on its standard input, ``webhook`` as a POST (reference unresolved), ``desktop`` as a
    notification of the person's own session.
    """

    command: tuple[str, ...] = ()
    webhook: str | None = None
    desktop: bool = False


@dataclass(frozen=True, slots=True)
class Daemon:
    """How the deployment is kept alive.

    ``interval`` and ``claim_seconds`` are in seconds: the fallback between two looks, and the longest that a claim
    holds without new evidence. ``heal_attempts`` are the tries before a problem is frozen. ``apply`` is ``auto`` or
    ``ask``: whether new kinds of hardware are onboarded at once. ``calls_per_hour`` and ``usd_per_hour`` cap the agents
    (None: no limit in dollars). ``metrics`` is the absolute path of the file for Prometheus.
    """

    interval: float = 300
    heal_attempts: int = 3
    apply: str = "auto"
    calls_per_hour: int = 30
    usd_per_hour: float | None = None
    claim_seconds: float = 1800
    notify: Notify = Notify()
    metrics: Path | None = None


@dataclass(frozen=True, slots=True)
class NamedStep:
    """A privileged step as the manifest switches it on, with its place there; ``source`` is the line, secrets masked.

    Whether there is such a step is not known here: it is a file of the protocol.
    """

    name: str
    span: Span
    source: str | None = None


@dataclass(frozen=True, slots=True)
class Manifest:
    """One octopus.yaml that has no errors.

    ``path`` is absolute, and so are the files of ``profiles`` (in the order of the manifest). ``digest`` is of the
    content with every default filled in: comments, order and layout do not move it, and neither does a default that a
    newer version adds.
    ``variables`` are the names of all environment variables that the manifest refers to, passes on or takes a key from,
    sorted. ``prices`` are by the model's name as `StageSettings.model` has it; ``run_usd`` is what one run may cost in
    all, in US dollars. ``network`` is None in scope local, ``tunnel`` in every scope but internet. ``answers`` are what
    a person answered about a device, by the device's id. ``step`` is in force for every privileged step (None only
    where a manifest was made without a file); ``privileged_steps`` are those that are switched on, in the order of the
    file. ``keepers`` are WATCH and HEAL, the agents that the daemon asks.
    """

    path: Path
    digest: str
    host: str
    scope: str
    profiles: tuple[ProfileSource, ...]
    stages: Mapping[str, StageSettings]
    lifecycle: Lifecycle
    git: Git
    variables: tuple[str, ...] = ()
    prices: Mapping[str, Price] = field(default_factory=dict)
    run_usd: float | None = None
    housekeeping: Housekeeping | None = None
    network: Network | None = None
    tunnel: Tunnel | None = None
    policy: Policy = field(default_factory=Policy)
    answers: Mapping[str, str] = field(default_factory=dict)
    perception: Perception = Perception()
    daemon: Daemon = Daemon()
    step: StageSettings | None = None
    keepers: Mapping[str, StageSettings] = field(default_factory=dict)
    privileged_steps: tuple[NamedStep, ...] = ()

    @property
    def project(self) -> Path:
        """The folder of the manifest, absolute."""
        return self.path.parent

    @property
    def profile_files(self) -> tuple[Path, ...]:
        """The profiles that are files of their own."""
        return tuple(item for item in self.profiles if isinstance(item, Path))

    def settings_of(self, stage: str) -> StageSettings:
        """The settings in force for a stage, for ``watch`` and ``heal``, or for a privileged step by its node's name.

        KeyError for another name.
        """
        if stage in KEEPERS:
            return self.keepers[stage]
        if stage.startswith(STEP) and self.step is not None:
            return self.step
        return self.stages[stage]

    def harness_for(self, stage: str) -> HarnessSpec:
        """The harness that runs a stage or step."""
        return self.settings_of(stage).harness

    def model_for(self, stage: str) -> str | None:
        """The model of its agent, reference unresolved; None when its harness uses none."""
        return self.settings_of(stage).model

    def budget_for(self, stage: str) -> Budget:
        """The budget of a stage or step."""
        return self.settings_of(stage).budget

    def camera_hint(self) -> dict[str, str]:
        """The setting that names a camera, by its place in the file; empty where none is named."""
        camera = self.perception.camera
        return {"perception.camera": camera} if camera is not None else {}

    def settings_for(self, stage: str) -> dict[str, object]:
        """The JSON-able settings that the key of a stage reads: changing one of them makes the stage run again.

        Attempts and timeouts are in no key: they decide whether an output comes, never what it states.
        """
        return {"tools": self.budget_for(stage).tools} if stage == "interface" else {}
