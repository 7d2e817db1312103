"""From the checked document to the frozen `Manifest`: defaults filled in, stages resolved. (Heavy: the document.)

From the checked policy to its frozen value: texts of times become numbers. (Heavy: the document.)
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from octoform.base import digest
from octoform.base.durations import seconds
from octoform.manifest import model_url, references
from octoform.manifest.credentials import LOGINS, Provider, split_model
from octoform.manifest.model import (
    KEEPERS,
    MODEL_FREE,
    STAGES,
    Budget,
    Daemon,
    Escalation,
    Git,
    HarnessSpec,
    Housekeeping,
    Lifecycle,
    Manifest,
    Network,
    Notify,
    Perception,
    Price,
    ProfileSource,
    Sandbox,
    StageSettings,
    Tunnel,
)
from octoform.manifest.schema import document, sections
from octoform.manifest.schema import sections as policy_schema
from octoform.manifest.schema.document import Document, Stage
from octoform.manifest.schema.document import Housekeeping as HousekeepingTable
from octoform.manifest.schema.harness import (
    AUTO,
    CommandHarness,
    Confinement,
    Harness,
    ModelHarness,
    ProgramHarness,
    ReplayHarness,
)
from octoform.manifest.yaml_tree import Loc
from octoform.policy import Limit, kinds
from octoform.policy.resolve import Policy, Rule
from octoform.records import dataclass

# Who works where: the agents that are in force in a document, and the variable with each one's key.
#
# (Heavy: the document.)

PROBE = STAGES[0]
HOUSEKEEPER = "litellm"
"""The service for the completions that summarise logs; a bare model name belongs to its provider."""


@dataclass(frozen=True, slots=True)
class Agent:
    """An agent in force, and where the file states that; ``model_at`` is there also where no model is given."""

    harness: Harness
    at: Loc
    model: str | None
    model_at: Loc

    @property
    def name(self) -> str:
        """The name of its harness."""
        return self.harness if isinstance(self.harness, str) else self.harness.name

    @property
    def settings(self) -> ModelHarness | None:
        """Its settings as an agent with a model, None where it has none of them."""
        return self.harness if isinstance(self.harness, ModelHarness) else None

    @property
    def needs_model(self) -> bool:
        """True for one that cannot work without a model."""
        return self.takes_model and not isinstance(self.harness, CommandHarness)

    @property
    def takes_model(self) -> bool:
        """True for one that does something with a model's name: a command finds it in its task."""
        return self.name not in MODEL_FREE


def of_stage(document: Document, name: str) -> Agent:
    """The agent of a stage, or of one of `KEEPERS`.

    A recorded run holds no problems of a later day: where the general agent is one, the embedded agent keeps watch. A
    model has nothing to add to what the kernel lists: where the general agent needs one, the embedded agent does PROBE.
    """
    own: Stage = getattr(document.stages, name)
    general = Agent(document.harness, ("harness",), document.model, ("model",))
    if name == PROBE and own.harness is None and own.model is None and general.needs_model:
        return Agent("builtin", ("harness",), None, ("stages", name, "model"))
    if name in KEEPERS and own.harness is None and isinstance(document.harness, ReplayHarness):
        return Agent("builtin", ("harness",), own.model, ("stages", name, "model"))
    harness, at = (own.harness, ("stages", name)) if own.harness is not None else (document.harness, ())
    model, model_at = (own.model, ("stages", name)) if own.model is not None else (document.model, ())
    return Agent(harness, (*at, "harness"), model, (*model_at, "model"))


def of_steps(document: Document) -> Agent:
    """The agent of the privileged steps: the general one."""
    return Agent(document.harness, ("harness",), document.model, ("model",))


def of_escalation(document: Document) -> Agent | None:
    """The agent that gets what IDENTIFY's own one left unknown, if there is one."""
    own = document.stages.identify.escalate
    if own is None:
        return None
    at: Loc = ("stages", "identify", "escalate")
    model, model_at = (own.model, at) if own.model is not None else (document.model, ())
    return Agent(own.harness, (*at, "harness"), model, (*model_at, "model"))


def in_force(document: Document) -> list[Agent]:
    """Every agent that may work, in the order of the stages."""
    found = [of_stage(document, name) for name in (*STAGES, *KEEPERS)]
    found += [of_steps(document)] if document.privileged_steps else []
    escalation = of_escalation(document)
    return [*found, escalation] if escalation is not None else found


def provider_of(model: str, harness: str, environ: Mapping[str, str]) -> Provider | None:
    """The provider of a model; None as long as a variable in its name has no value."""
    named = resolved(model, environ)
    return split_model(named, harness)[0] if named is not None else None


def key_of(
    settings: ModelHarness | HousekeepingTable | None, provider: Provider | None, environ: Mapping[str, str]
) -> str | None:
    """The variable with the key: the one that is named, else the provider's usual one.

    None where none is needed: the provider takes none, or the API is on this machine and none is named.
    """
    if settings is not None and settings.key is not None:
        return settings.key
    if isinstance(settings, ProgramHarness) and has_login(settings) and settings.name in LOGINS:
        return LOGINS[settings.name].variable
    url = resolved(settings.base_url, environ) if settings is not None and settings.base_url is not None else None
    if provider is None or (url is not None and model_url.is_loopback(url)):
        return None
    return provider.key


def has_login(settings: ModelHarness | HousekeepingTable) -> bool:
    """Whether the person's own login with the program replaces a key."""
    return isinstance(settings, ProgramHarness) and settings.login


def resolved(text: str, environ: Mapping[str, str]) -> str | None:
    """A string with its references replaced, None as long as one of them has no value. Never to be kept or shown."""
    is_whole = not references.malformed(text) and all(environ.get(name) for name in references.names(text))
    return references.resolve(text, environ) if is_whole else None


def policy(source: policy_schema.Policy) -> Policy:
    """The policy of a document without errors."""
    return Policy(
        mode=source.mode,
        read=source.read,
        actuate=source.actuate,
        irreversible=source.irreversible,
        rules=tuple(Rule(tuple(rule.tools), rule.decision) for rule in source.rules),
        limits=tuple(_limit(limit.model_dump()) for limit in source.limits),
        timeout=seconds(source.timeout) or 0,
        timeouts=tuple((glob, seconds(length) or 0) for glob, length in sorted(source.timeouts.items())),
        result_bytes=source.result_bytes,
    )


def _limit(source: Mapping[str, Any]) -> Limit:
    given = kinds.values({name: _plain(value) for name, value in source.items()})
    return Limit(source["tool"], source["parameter"], units=source["units"], **given)


def _plain(value: Any) -> Any:
    """An integer as one, so that messages show it as it was written."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def build(
    source: Document,
    path: Path,
    profiles: tuple[ProfileSource, ...],
    variables: tuple[str, ...],
    environ: Mapping[str, str],
) -> Manifest:
    """The manifest of a document without errors; ``environ`` resolves references to models."""
    builder = _Builder(source, path.parent, environ)
    stages = {name: builder.stage(name) for name in STAGES}
    keepers = {name: builder.stage(name) for name in KEEPERS}
    step = builder.steps()
    housekeeping = builder.housekeeping()
    makers = [*stages.values(), *keepers.values(), *([step] if source.privileged_steps else [])]
    return Manifest(
        path=path,
        digest=digest.of_value(source.model_dump(mode="json")),
        host=source.host,
        scope=source.scope,
        profiles=profiles,
        stages=MappingProxyType(stages),
        lifecycle=Lifecycle(source.lifecycle.prevent_destroy, tuple(source.lifecycle.ignore)),
        git=Git(source.git.commit),
        variables=tuple(sorted({*variables, *_keys(makers, housekeeping)})),
        prices=MappingProxyType({name: _price(price) for name, price in source.prices.items()}),
        run_usd=source.budget.usd,
        housekeeping=housekeeping,
        network=_network(source),
        tunnel=_tunnel(source),
        policy=policy(source.policy),
        perception=Perception(
            source.perception.enabled, source.perception.camera, seconds(source.perception.interval) or 0
        ),
        answers=MappingProxyType({name: text.strip() for name, text in source.answers.items()}),
        daemon=_daemon(source.daemon, path.parent),
        step=step,
        keepers=MappingProxyType(keepers),
    )


def _network(source: Document) -> Network | None:
    if source.scope == "local":
        return None
    chosen = source.network
    if chosen is None:
        return Network()
    return Network(chosen.interface, chosen.port, tuple(chosen.hosts), tuple(chosen.origins))


def _tunnel(source: Document) -> Tunnel | None:
    if source.scope != "internet":
        return None
    return Tunnel(tuple(source.tunnel.command)) if source.tunnel is not None else Tunnel()


def _daemon(chosen: sections.Daemon, project: Path) -> Daemon:
    found = chosen.notify
    return Daemon(
        interval=seconds(chosen.interval) or 0,
        heal_attempts=chosen.heal_attempts,
        apply=chosen.apply,
        calls_per_hour=chosen.calls_per_hour,
        usd_per_hour=chosen.usd_per_hour,
        claim_seconds=seconds(chosen.claim_expiry) or 0,
        notify=Notify(tuple(found.command or ()), found.webhook, found.desktop),
        metrics=Path(os.path.normpath(project / chosen.metrics)) if chosen.metrics is not None else None,
    )


def _keys(makers: Sequence[StageSettings], housekeeping: Housekeeping | None) -> Iterator[str]:
    """The variables with the keys of all agents, also of those that the file does not name."""
    specs = [maker.harness for maker in makers]
    specs += [maker.escalate.harness for maker in makers if maker.escalate is not None]
    for key in (*(spec.key for spec in specs), housekeeping.key if housekeeping is not None else None):
        if key is not None:
            yield key


class _Builder:
    """Makes the parts that need the variables or the folder."""

    def __init__(self, source: Document, project: Path, environ: Mapping[str, str]) -> None:
        self._source = source
        self._project = project
        self._environ = environ

    def stage(self, name: str) -> StageSettings:
        agent = of_stage(self._source, name)
        own: document.Stage = getattr(self._source.stages, name)
        escalation = of_escalation(self._source) if name == "identify" else None
        return StageSettings(
            self._harness(agent),
            _model(agent),
            _budget(self._source.budget, own.budget),
            Escalation(self._harness(escalation), _model(escalation)) if escalation is not None else None,
        )

    def steps(self) -> StageSettings:
        """The settings for every privileged step: the general settings."""
        agent = of_steps(self._source)
        budget = _budget(self._source.budget, document.StageBudget.model_construct())
        return StageSettings(self._harness(agent), _model(agent), budget)

    def _harness(self, agent: Agent) -> HarnessSpec:
        chosen = agent.harness
        if isinstance(chosen, CommandHarness):
            sandbox = _sandbox(chosen.sandbox)
            return HarnessSpec(chosen.name, tuple(chosen.command), tuple(chosen.env), chosen.prompt, sandbox=sandbox)
        if isinstance(chosen, ReplayHarness):
            recording = Path(os.path.normpath(self._project / chosen.recording))
            return HarnessSpec(chosen.name, recording=recording)
        key = self._key(agent) if agent.needs_model else None
        if not isinstance(chosen, ModelHarness):
            return HarnessSpec(agent.name, key=key)
        command = chosen.command if isinstance(chosen, ProgramHarness) else None
        return HarnessSpec(
            name=agent.name,
            command=tuple(command or ()),
            env=tuple(chosen.env),
            key=key,
            base_url=chosen.base_url,
            api=chosen.api,
            web_search=chosen.web_search,
            login=isinstance(chosen, ProgramHarness) and chosen.login,
            sandbox=_sandbox(chosen.sandbox),
        )

    def _key(self, agent: Agent) -> str | None:
        provider = provider_of(agent.model or "", agent.name, self._environ)
        return key_of(agent.settings, provider, self._environ)

    def housekeeping(self) -> Housekeeping | None:
        settings = self._source.housekeeping
        if settings is None:
            return None
        provider = provider_of(settings.model, HOUSEKEEPER, self._environ)
        key = key_of(settings, provider, self._environ)
        return Housekeeping(settings.model, settings.max_tokens, key, settings.base_url)


def _model(agent: Agent) -> str | None:
    return agent.model if agent.takes_model else None


def _sandbox(chosen: bool | Literal["auto"] | Confinement) -> Sandbox | None:
    if chosen == AUTO:
        return Sandbox()
    if isinstance(chosen, Confinement):
        return Sandbox(chosen.network, required=True)
    return Sandbox(required=True) if chosen else None


def _price(chosen: document.Price) -> Price:
    return Price(chosen.input, chosen.input if chosen.cached is None else chosen.cached, chosen.output)


def _budget(general: document.Budget, own: document.StageBudget) -> Budget:
    attempt, stage = timeouts(general, own)
    return Budget(
        attempts=own.attempts or general.attempts,
        attempt_seconds=attempt,
        stage_seconds=stage,
        tools=general.tools,
        idle_seconds=idle(general, own),
        turns=own.turns or general.turns,
        usd=own.usd,
        edit_specs=general.edit_specs,
    )


def timeouts(general: document.Budget, own: document.StageBudget) -> tuple[float, float]:
    """Seconds for one attempt and for a whole stage, the stage's own settings first."""
    attempt = seconds(own.attempt_timeout or general.attempt_timeout)
    stage = seconds(own.stage_timeout or general.stage_timeout)
    return float(attempt or 0), float(stage or 0)


def idle(general: document.Budget, own: document.StageBudget) -> float | None:
    """Seconds without a sign of progress, the stage's own setting first; None where no one chose them."""
    chosen = own.idle_timeout or general.idle_timeout
    return float(seconds(chosen) or 0) if chosen is not None else None
