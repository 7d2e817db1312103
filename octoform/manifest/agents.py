"""Who works where: the agents that are in force in a document, and the variable with each one's key.

(Heavy: the document.)
"""

from collections.abc import Mapping
from dataclasses import dataclass

from octoform.manifest import base_url, references
from octoform.manifest.credentials import LOGINS
from octoform.manifest.model import KEEPERS, MODEL_FREE, STAGES
from octoform.manifest.providers import Provider, split
from octoform.manifest.schema.document import Document, Housekeeping, Stage
from octoform.manifest.schema.harness import CommandHarness, Harness, ModelHarness, ProgramHarness, ReplayHarness
from octoform.manifest.source.tree import Loc

PROBE = STAGES[0]
HOUSEKEEPER = "litellm"
"""What makes the completions that condense logs; a bare name of a model belongs to whom it does there."""


@dataclass(frozen=True, slots=True)
class Agent:
    """An agent in force, and where the file says so; ``model_at`` is there also where no model is given."""

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

    A recorded run holds no troubles of a later day: where the general agent is one, the embedded agent keeps watch. A
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
    """Who serves a model; None as long as a variable in its name has no value."""
    named = resolved(model, environ)
    return split(named, harness)[0] if named is not None else None


def key_of(
    settings: ModelHarness | Housekeeping | None, provider: Provider | None, environ: Mapping[str, str]
) -> str | None:
    """The variable with the key: the one that is named, else the provider's usual one.

    None where none is needed: the provider takes none, or the API is on this machine and none is named.
    """
    if settings is not None and settings.key is not None:
        return settings.key
    if isinstance(settings, ProgramHarness) and has_login(settings) and settings.name in LOGINS:
        return LOGINS[settings.name].variable
    url = resolved(settings.base_url, environ) if settings is not None and settings.base_url is not None else None
    if provider is None or (url is not None and base_url.is_loopback(url)):
        return None
    return provider.key


def has_login(settings: ModelHarness | Housekeeping) -> bool:
    """Whether the person's own login with the program stands in for a key."""
    return isinstance(settings, ProgramHarness) and settings.login


def resolved(text: str, environ: Mapping[str, str]) -> str | None:
    """A text with its references replaced, None as long as one of them has no value. Never to be kept or shown."""
    is_whole = not references.malformed(text) and all(environ.get(name) for name in references.names(text))
    return references.resolve(text, environ) if is_whole else None
