"""Rules on the agents of a document: a model where one is needed, a key that is there, settings that have an effect.

(Heavy: the document.)
"""

from collections.abc import Mapping

from octoform.diagnostics import Span
from octoform.manifest import agents, base_url, credentials, references
from octoform.manifest.agents import Agent, has_login
from octoform.manifest.credentials import LOGINS
from octoform.manifest.providers import SEARCHERS
from octoform.manifest.schema.document import Document
from octoform.manifest.schema.harness import Confinement, ModelHarness
from octoform.manifest.source import tree
from octoform.manifest.source.report import Report
from octoform.manifest.source.tree import Loc, Table

_MODEL_HINT = "write for example `model: anthropic/claude-sonnet-4-5`"
_FREE = {"builtin": "the embedded agent uses none", "replay": "a recorded run uses none"}


def check(document: Document, root: Table, environ: Mapping[str, str], report: Report) -> None:
    """Report what does not fit together."""
    _Rules(document, root, environ, report).check()


class _Rules:
    """The rules over one document; the same place is told once, however many stages it holds for."""

    def __init__(self, document: Document, root: Table, environ: Mapping[str, str], report: Report) -> None:
        self._document = document
        self._root = root
        self._environ = environ
        self._report = report
        self._told: set[tuple[str, object]] = set()

    def check(self) -> None:
        in_force = agents.in_force(self._document)
        for agent in in_force:
            if agent.needs_model and agent.model is None:
                self._no_model(agent)
            elif agent.needs_model:
                self._key(agent)
            self._settings(agent)
        self._unused_models(in_force)
        self._escalation()
        self._housekeeping()

    def _span(self, loc: Loc) -> Span:
        node = tree.at(self._root, loc)
        return node.span if node is not None else self._root.span

    def _is_new(self, rule: str, what: object) -> bool:
        is_new = (rule, what) not in self._told
        self._told.add((rule, what))
        return is_new

    def _no_model(self, agent: Agent) -> None:
        if self._is_new("model", agent.at):
            what = f"the harness `{agent.name}` needs a model, and none is named"
            self._report.error("MANIFEST-NO-MODEL", what, self._span(agent.at), hint=_MODEL_HINT)

    def _key(self, agent: Agent) -> None:
        """Tell of a key that the agent will look for by itself and not find; a named one is told where it stands."""
        provider = agents.provider_of(agent.model or "", agent.name, self._environ)
        settings = agent.settings
        if settings is None or (settings.key is None and not has_login(settings)):
            self._unset(agents.key_of(settings, provider, self._environ), f"`{agent.name}`", agent.at)

    def _unset(self, key: str | None, who: str, loc: Loc) -> None:
        complaint = credentials.complaint(key, self._environ) if key is not None else None
        if complaint is not None and self._is_new("key", key):
            self._report.warning(
                "MANIFEST-ENV-UNSET",
                f"{complaint}; {who} finds the key of its model's API there",
                self._span(loc),
                hint=f"export {key}, or name another variable in `key`",
            )

    def _settings(self, agent: Agent) -> None:
        settings = agent.settings
        if settings is None or not self._is_new("settings", agent.at):
            return
        self._base_url(settings.base_url, (*agent.at, "base_url"))
        self._network(agent, settings)
        if settings.web_search and agent.name not in SEARCHERS:
            self._report.error(
                "MANIFEST-WRONG-VALUE",
                f"`{agent.name}` has no search of the web",
                self._span((*agent.at, "web_search")),
                hint=f"remove it, or choose one that has: {', '.join(SEARCHERS)}",
            )
        self._login(agent)
        provider = agents.provider_of(agent.model, agent.name, self._environ) if agent.model is not None else None
        if settings.api is None or settings.base_url is not None or provider is None or settings.api in provider.urls:
            return
        self._report.error(
            "MANIFEST-WRONG-VALUE",
            f"{provider.name} does not serve its models over {settings.api}",
            self._span((*agent.at, "api")),
            hint=f"remove it, or choose {' or '.join(provider.urls)}",
        )

    def _login(self, agent: Agent) -> None:
        """A login is one program's with one provider, and no key beside it."""
        settings = agent.settings
        if settings is None or not has_login(settings):
            return
        login = LOGINS.get(agent.name)
        provider = agents.provider_of(agent.model, agent.name, self._environ) if agent.model is not None else None
        if login is None:
            what, hint = f"octoform can use no login of `{agent.name}`", f"use a key, or choose {' or '.join(LOGINS)}"
        elif settings.key is not None:
            what, hint = "`login` and `key` exclude each other", "remove one of them"
        elif provider is not None and provider.name != login.provider:
            what = f"a login of `{agent.name}` is one with {login.provider}, and the model is of {provider.name}"
            hint = "remove it and use a key, or choose another model"
        else:
            return
        self._report.error("MANIFEST-WRONG-VALUE", what, self._span((*agent.at, "login")), hint=hint)

    def _network(self, agent: Agent, settings: ModelHarness) -> None:
        """Not even a server on this machine is reached from there."""
        if isinstance(settings.sandbox, Confinement) and not settings.sandbox.network:
            self._report.error(
                "MANIFEST-WRONG-VALUE",
                f"without a network `{agent.name}` cannot reach its model",
                self._span((*agent.at, "sandbox", "network")),
                hint="write `sandbox: true`",
            )

    def _base_url(self, text: str | None, loc: Loc) -> None:
        """A URL with references is looked at with their values; the values are not shown."""
        url = agents.resolved(text, self._environ) if text is not None and references.contains(text) else None
        complaint = base_url.complaint(url) if url is not None else None
        if complaint is not None:
            what = f"`{loc[-1]}` with the values of its variables: {complaint[0]}"
            self._report.error("MANIFEST-WRONG-VALUE", what, self._span(loc), hint=complaint[1])

    def _unused_models(self, in_force: list[Agent]) -> None:
        """A model that no agent asks for would look as if it were in force."""
        for loc in dict.fromkeys(agent.model_at for agent in in_force if agent.model is not None):
            askers = [agent for agent in in_force if agent.model_at == loc]
            if not any(agent.takes_model for agent in askers):
                self._unused(loc, f"this model has no effect: {_FREE[askers[0].name]}", "choose another harness")
        if self._document.model is not None and not any(agent.model_at == ("model",) for agent in in_force):
            self._unused(("model",), "this model has no effect: every stage has its own", "remove those of the stages")

    def _unused(self, loc: Loc, what: str, otherwise: str) -> None:
        key = tree.key_at(self._root, loc)
        if key is not None:
            self._report.warning("MANIFEST-UNUSED", what, key.span, hint=f"remove it, or {otherwise}")

    def _escalation(self) -> None:
        if self._document.stages.identify.escalate is None:
            return
        own = agents.of_stage(self._document, "identify")
        key = tree.key_at(self._root, ("stages", "identify", "escalate"))
        if own.name != "builtin" and key is not None:
            self._report.error(
                "MANIFEST-ESCALATION",
                f"only the embedded agent escalates, and IDENTIFY is run by `{own.name}`",
                key.span,
                hint="remove it, or write `harness: builtin` beside it",
            )

    def _housekeeping(self) -> None:
        settings = self._document.housekeeping
        if settings is None:
            return
        self._base_url(settings.base_url, ("housekeeping", "base_url"))
        if settings.key is None:
            provider = agents.provider_of(settings.model, agents.HOUSEKEEPER, self._environ)
            self._unset(agents.key_of(settings, provider, self._environ), "housekeeping", ("housekeeping", "model"))
