"""Rules about the text of values, wherever they stand: references to variables, and secrets."""

from collections.abc import Mapping

from octoform.diagnostics import Span
from octoform.manifest import conversion, credentials, model_url, references, yaml_tree
from octoform.manifest.conversion import Agent, has_login
from octoform.manifest.credentials import APIS, LOGINS, PROVIDERS, SEARCHERS, SPOKEN
from octoform.manifest.problem_list import ProblemList
from octoform.manifest.schema.document import Document
from octoform.manifest.schema.harness import Confinement, ModelHarness
from octoform.manifest.yaml_tree import Loc, Node, Scalar, Table
from octoform.patterns import regex

_WHERE = "variables may be in `model`, `base_url`, `webhook` and the `command` of an agent only"
_KEY_NAME = regex("[A-Z_][A-Z0-9_]{0,99}")
_REFERENCE = regex(r"(?<!\$)\$\{[^{}]*\}?")


def check_secrets(root: Node, report: ProblemList) -> None:
    """Refuse every literal that looks like a secret, in values, keys and comments, and mask it everywhere."""
    names: set[str] = set()
    for number, line in enumerate(report.lines, 1):
        for start, end in credentials.found_in(line):
            names.add(line[start:end])
            _refuse(Span(number, start + 1, end + 1), report)
    for loc, scalar in yaml_tree.scalars(root):
        if _may_hide_one(loc, scalar):
            _mask(scalar, report)
        found = _secrets_of(root, loc, scalar)
        if found:
            report.settle(loc)
        if found - names:
            _mask(scalar, report)
            _refuse(scalar.span, report)


def _secrets_of(root: Node, loc: Loc, scalar: Scalar) -> set[str]:
    text = scalar.text
    if not isinstance(scalar.value, str) or not text:
        return set()
    found = {text[start:end] for start, end in (*credentials.found_in(text), *credentials.assigned_in(text))}
    is_named = not found and not references.contains(text) and _is_named_secret(root, loc)
    return {text} if is_named else found


def _may_hide_one(loc: Loc, scalar: Scalar) -> bool:
    """True for what is no name where the name of a variable belongs, for a URL with more than a path,
    and for a webhook.

    The first two are refused by another rule. The text may be the secret itself and is not shown.
    """
    if scalar.value is None:
        return False
    if loc in yaml_tree.KEYS:
        return _KEY_NAME.fullmatch(scalar.text) is None and not references.contains(scalar.text)
    if loc == yaml_tree.WEBHOOK:
        return not references.contains(scalar.text)
    return loc in yaml_tree.BASE_URLS and any(sign in scalar.text for sign in "@?#")


def _is_named_secret(root: Node, loc: Loc) -> bool:
    """True for the value of a key, or behind an option, whose name states that it is a secret."""
    if loc and isinstance(loc[-1], str):
        return credentials.is_secret_name(loc[-1])
    if loc and isinstance(loc[-1], int) and loc[-1] > 0:
        before = yaml_tree.at(root, (*loc[:-1], loc[-1] - 1))
        return isinstance(before, Scalar) and before.text.startswith("-") and credentials.is_secret_name(before.text)
    return False


def _mask(scalar: Scalar, report: ProblemList) -> None:
    """Mask a value wherever it reaches to; a quoted or folded text may go on for several lines."""
    report.mask(scalar.span)
    for number in range(scalar.span.line + 1, scalar.last_line + 1):
        report.mask(Span(number, 1))


def _refuse(span: Span, report: ProblemList) -> None:
    report.error(
        "MANIFEST-SECRET",
        "this looks like a secret",
        span,
        hint="keep it in the environment and name the variable; if it is a real one, revoke it now",
    )


def check_references(root: Table, environ: Mapping[str, str], report: ProblemList) -> tuple[str, ...]:
    """Check every ``${NAME}``, and give the names of all variables that the manifest refers to or passes on."""
    found: set[str] = set()
    for loc, scalar in yaml_tree.scalars(root):
        pattern = _KEY_NAME if loc in yaml_tree.KEYS else references.NAME
        if _names_only(loc) and pattern.fullmatch(scalar.text) and not report.is_settled(loc):
            found.add(scalar.text)
            is_key = loc in yaml_tree.KEYS
            complaint = credentials.complaint(scalar.text, environ) if is_key or scalar.text not in environ else None
            if complaint is not None:
                otherwise = "name another variable" if is_key else "take it out of `env`"
                effect = "no agent is started" if scalar.text in environ else "the agent will run without it"
                report.warning(
                    "MANIFEST-ENV-UNSET",
                    f"{complaint}; {effect}",
                    scalar.span,
                    hint=f"export {scalar.text}, or {otherwise}",
                )
        elif references.contains(scalar.text):
            found |= _check_one(loc, scalar, environ, report)
    return tuple(sorted(found))


def _check_one(loc: Loc, scalar: Scalar, environ: Mapping[str, str], report: ProblemList) -> set[str]:
    span = _reference_span(scalar, report)
    if not _may_refer(loc):
        report.error(
            "MANIFEST-ENV-NOT-ALLOWED",
            "a variable is not allowed here",
            span,
            hint=_names_only(loc) or _WHERE,
        )
        return set()
    for text in references.malformed(scalar.text):
        report.error(
            "MANIFEST-WRONG-VALUE",
            f"`{report.shown(text)}` is no reference to a variable",
            span,
            hint="write ${NAME}, or $${ for a plain ${",
        )
    names = set(references.names(scalar.text))
    for name in sorted(names):
        if not environ.get(name):
            state = "is empty" if name in environ else "is not set"
            if loc == yaml_tree.WEBHOOK:  # nothing but a message depends on it
                what = f"the variable {name} {state}; the daemon can notify no one at this URL"
                report.warning("MANIFEST-ENV-UNSET", what, span, hint=f"export {name}=...")
                continue
            report.error("MANIFEST-ENV-UNSET", f"the variable {name} {state}", span, hint=f"export {name}=...")
    return names


def _may_refer(loc: Loc) -> bool:
    if loc[-1:] == ("model",) or loc in yaml_tree.BASE_URLS or loc == yaml_tree.WEBHOOK:
        return True
    return len(loc) > 1 and loc[-2] == "command" and "harness" in loc


def _names_only(loc: Loc) -> str | None:
    """The text to write where a value is the name of a variable; None for all other places."""
    if loc in yaml_tree.KEYS:
        return "write the name only, without ${}"
    is_of_a_list = len(loc) > 2 and loc[-3:-1] == ("harness", "env") and isinstance(loc[-1], int)
    return "list names only, without ${}" if is_of_a_list else None


def _reference_span(scalar: Scalar, report: ProblemList) -> Span:
    """The place of the first reference inside a value, where the value stands on one line."""
    line = report.lines[scalar.span.line - 1] if scalar.span.line <= len(report.lines) else ""
    end = scalar.span.end_column - 1 if scalar.span.end_column is not None else len(line)
    found = _REFERENCE.search(line, scalar.span.column - 1, end)
    if found is None:
        return scalar.span
    return Span(scalar.span.line, found.start() + 1, found.end() + 1)


# Rules on the agents of a document: a model where one is needed, a key that is there, settings that have an effect.
#
# (Heavy: the document.)

_MODEL = "anthropic/claude-sonnet-4-5"
_MODELS = {"codex": "openai/gpt-5", "gemini-cli": "gemini/gemini-3-flash-preview"}
"""A model as an example, for programs that cannot talk to the provider of the usual one."""
_FREE = {"builtin": "the embedded agent uses none", "replay": "a recorded run uses none"}


def check(document: Document, root: Table, environ: Mapping[str, str], report: ProblemList) -> None:
    """Report what does not fit together."""
    _Rules(document, root, environ, report).check()


_OTHER_KEY = "name another variable in `key`"


class _Rules:
    """The rules over one document; the same place is reported once, however many stages it holds for."""

    def __init__(self, document: Document, root: Table, environ: Mapping[str, str], report: ProblemList) -> None:
        self._document = document
        self._root = root
        self._environ = environ
        self._report = report
        self._reported: set[tuple[str, object]] = set()

    def check(self) -> None:
        in_force = conversion.in_force(self._document)
        for agent in in_force:
            if agent.needs_model and agent.model is None:
                self._no_model(agent)
            elif agent.needs_model:
                self._key(agent)
                self._spoken(agent)
            self._settings(agent)
        self._unused_models(in_force)
        self._escalation()
        self._housekeeping()

    def _span(self, loc: Loc) -> Span:
        node = yaml_tree.at(self._root, loc)
        return node.span if node is not None else self._root.span

    def _is_new(self, rule: str, what: object) -> bool:
        is_new = (rule, what) not in self._reported
        self._reported.add((rule, what))
        return is_new

    def _no_model(self, agent: Agent) -> None:
        if self._is_new("model", agent.at):
            what = f"the harness `{agent.name}` needs a model, and none is named"
            hint = f"write for example `model: {_MODELS.get(agent.name, _MODEL)}`"
            self._report.error("MANIFEST-NO-MODEL", what, self._span(agent.at), hint=hint)

    def _key(self, agent: Agent) -> None:
        """Report a key that the agent will look for by itself and not find; a named one where it is named."""
        provider = conversion.provider_of(agent.model or "", agent.name, self._environ)
        settings = agent.settings
        if settings is None or (settings.key is None and not has_login(settings)):
            login = f"{_OTHER_KEY}, or where you are logged in: `harness: {{name: {agent.name}, login: true}}`"
            has_one = agent.name in LOGINS and provider is not None and provider.name == LOGINS[agent.name].provider
            otherwise = login if has_one else _OTHER_KEY
            self._unset(conversion.key_of(settings, provider, self._environ), f"`{agent.name}`", agent.at, otherwise)

    def _unset(self, key: str | None, who: str, loc: Loc, otherwise: str) -> None:
        complaint = credentials.complaint(key, self._environ) if key is not None else None
        if complaint is not None and self._is_new("key", key):
            self._report.warning(
                "MANIFEST-ENV-UNSET",
                f"{complaint}; {who} finds the key of its model's API there",
                self._span(loc),
                hint=f"export {key}, or {otherwise}",
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
        provider = conversion.provider_of(agent.model, agent.name, self._environ) if agent.model is not None else None
        if settings.api is None or settings.base_url is not None or provider is None or settings.api in provider.urls:
            return
        self._report.error(
            "MANIFEST-WRONG-VALUE",
            f"{provider.name} does not serve its models over {settings.api}",
            self._span((*agent.at, "api")),
            hint=f"remove it, or choose {' or '.join(provider.urls)}",
        )

    def _spoken(self, agent: Agent) -> None:
        """A program and a provider have an API in common, unless a URL leads elsewhere; for a login see `_login`."""
        provider = conversion.provider_of(agent.model or "", agent.name, self._environ)
        spoken, settings = SPOKEN.get(agent.name, APIS), agent.settings
        if provider is None or any(api in provider.urls for api in spoken):
            return
        is_elsewhere = settings is not None and (settings.base_url is not None or has_login(settings))
        if not is_elsewhere and self._is_new("spoken", (agent.name, agent.model_at)):
            others = [each.name for each in PROVIDERS.values() if any(api in each.urls for api in spoken)]
            self._report.error(
                "MANIFEST-WRONG-VALUE",
                f"`{agent.name}` cannot talk to {provider.name}: it speaks {' or '.join(spoken)}",
                self._span(agent.model_at),
                hint=f"choose a model of one of these: {', '.join(others)}; or another harness, or a `base_url`",
            )

    def _login(self, agent: Agent) -> None:
        """A login is one program's with one provider, and no key beside it."""
        settings = agent.settings
        if settings is None or not has_login(settings):
            return
        login = LOGINS.get(agent.name)
        provider = conversion.provider_of(agent.model, agent.name, self._environ) if agent.model is not None else None
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
        url = conversion.resolved(text, self._environ) if text is not None and references.contains(text) else None
        complaint = model_url.url_complaint(url) if url is not None else None
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
        key = yaml_tree.key_at(self._root, loc)
        if key is not None:
            self._report.warning("MANIFEST-UNUSED", what, key.span, hint=f"remove it, or {otherwise}")

    def _escalation(self) -> None:
        if self._document.stages.identify.escalate is None:
            return
        own = conversion.of_stage(self._document, "identify")
        key = yaml_tree.key_at(self._root, ("stages", "identify", "escalate"))
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
            provider = conversion.provider_of(settings.model, conversion.HOUSEKEEPER, self._environ)
            self._unset(
                conversion.key_of(settings, provider, self._environ),
                "housekeeping",
                ("housekeeping", "model"),
                _OTHER_KEY,
            )
