"""From the checked document to the frozen `Manifest`: defaults filled in, stages resolved. (Heavy: the document.)

From the checked policy to its frozen value: texts of times become numbers. (Heavy: the document.)
"""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from octoform import digest
from octoform.durations import hours, rate, seconds
from octoform.manifest import agents
from octoform.manifest.agents import Agent
from octoform.manifest.model import (
    KEEPERS,
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
from octoform.manifest.policy_model import Limit, Policy, Rule
from octoform.manifest.schema import daemon, document
from octoform.manifest.schema import policy as policy_schema
from octoform.manifest.schema.document import Document
from octoform.manifest.schema.harness import (
    AUTO,
    CommandHarness,
    Confinement,
    ModelHarness,
    ProgramHarness,
    ReplayHarness,
)


def policy(source: policy_schema.Policy) -> Policy:
    """The policy of a document without errors."""
    return Policy(
        mode=source.mode,
        read=source.read,
        actuate=source.actuate,
        irreversible=source.irreversible,
        rules=tuple(Rule(tuple(rule.tools), rule.decision) for rule in source.rules),
        limits=tuple(_limit(limit) for limit in source.limits),
        timeout=seconds(source.timeout) or 0,
        timeouts=tuple((glob, seconds(length) or 0) for glob, length in sorted(source.timeouts.items())),
        result_bytes=source.result_bytes,
    )


def _limit(source: policy_schema.Limit) -> Limit:
    return Limit(
        tool=source.tool,
        parameter=source.parameter,
        minimum=_plain(source.minimum),
        maximum=_plain(source.maximum),
        step=_plain(source.step),
        cumulative=_plain(source.cumulative),
        rate=rate(source.rate) if source.rate is not None else None,
        cooldown=seconds(source.cooldown) if source.cooldown is not None else None,
        quiet_hours=hours(source.quiet_hours) if source.quiet_hours is not None else None,
        units=tuple(source.units),
    )


def _plain(value: float | None) -> float | None:
    """A whole number as one, so that messages show it as it was written."""
    return int(value) if value is not None and value.is_integer() else value


def build(
    source: Document,
    path: Path,
    profiles: tuple[ProfileSource, ...],
    variables: tuple[str, ...],
    environ: Mapping[str, str],
) -> Manifest:
    """The manifest of a document without errors; ``environ`` tells whose models are meant by a reference."""
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


def _daemon(chosen: daemon.Daemon, project: Path) -> Daemon:
    told = chosen.notify
    return Daemon(
        interval=seconds(chosen.interval) or 0,
        heal_attempts=chosen.heal_attempts,
        apply=chosen.apply,
        calls_per_hour=chosen.calls_per_hour,
        usd_per_hour=chosen.usd_per_hour,
        claim_seconds=seconds(chosen.claim_expiry) or 0,
        notify=Notify(tuple(told.command or ()), told.webhook, told.desktop),
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
        agent = agents.of_stage(self._source, name)
        own: document.Stage = getattr(self._source.stages, name)
        escalation = agents.of_escalation(self._source) if name == "identify" else None
        return StageSettings(
            self._harness(agent),
            _model(agent),
            _budget(self._source.budget, own.budget),
            Escalation(self._harness(escalation), _model(escalation)) if escalation is not None else None,
        )

    def steps(self) -> StageSettings:
        """What is in force for every privileged step: the general settings."""
        agent = agents.of_steps(self._source)
        return StageSettings(self._harness(agent), _model(agent), _budget(self._source.budget, document.StageBudget()))

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
        provider = agents.provider_of(agent.model or "", agent.name, self._environ)
        return agents.key_of(agent.settings, provider, self._environ)

    def housekeeping(self) -> Housekeeping | None:
        settings = self._source.housekeeping
        if settings is None:
            return None
        provider = agents.provider_of(settings.model, agents.HOUSEKEEPER, self._environ)
        key = agents.key_of(settings, provider, self._environ)
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
    """Seconds without a sign of progress, the stage's own setting first; None where nobody chose them."""
    chosen = own.idle_timeout or general.idle_timeout
    return float(seconds(chosen) or 0) if chosen is not None else None
