"""The way to a model in litellm's words: its name there, where it is, and the variable with the key.

litellm reads the API off the beginning of a name, and takes the base URL of each API in another form than the API's
own clients do. All of that is settled here, without the library.
"""

from collections.abc import Mapping, Sequence
from urllib.parse import urlsplit

from octoform.diagnostics import Diagnostic, error
from octoform.manifest import credentials
from octoform.manifest.credentials import ANTHROPIC, CHAT, GEMINI, LOGINS, RESPONSES, split_model
from octoform.manifest.model import HarnessSpec
from octoform.manifest.references import resolve
from octoform.records import dataclass

# How an agent reaches its model: over which API, where that is, and which variable holds the key.
#
# The key itself is never held here.

SUFFIXES = ("/v1", "/v1beta")


@dataclass(frozen=True, slots=True)
class Access:
    """One way to a model.

    ``model`` is the name that is sent to the API, ``named`` the one of the manifest; ``base_url`` is in the form that
    the API's own clients take (with ``/v1`` for the two of OpenAI, without for the others); ``key`` is the name of a
    variable, None where none is needed.
    """

    provider: str
    model: str
    named: str
    api: str
    base_url: str
    key: str | None


def access(
    spec: HarnessSpec, model: str | None, apis: Sequence[str], environ: Mapping[str, str]
) -> Access | Diagnostic:
    """The way to ``model`` over one of ``apis`` (the program's, the one it does best first), or what is missing."""
    if model is None:
        return error(
            "HARNESS-NO-MODEL",
            f"{spec.name} needs a model, and octopus.yaml names none",
            hint="write for example: model: anthropic/claude-sonnet-4-5",
        )
    provider, name = split_model(model, spec.name)
    spoken = [api for api in apis if spec.base_url is not None or api in provider.urls]
    if spec.api is not None:
        spoken = [api for api in spoken if api == spec.api]
    if not spoken:
        return error(
            "HARNESS-API",
            f"{spec.name} cannot talk to {provider.name}{f' over {spec.api}' if spec.api else ''}",
            hint=f"it speaks {', '.join(apis)}; choose another provider or harness, or a base_url of its own",
        )
    api = spoken[0]
    usual = LOGINS[spec.name].url if spec.login else None
    base_url = usual or provider.urls.get(api, "")
    if spec.base_url is not None:
        base_url = normalised(resolve(spec.base_url, environ), api)
    # With a base URL the manifest has settled the key: a server on this machine is not sent a provider's key unasked.
    key = spec.key if spec.base_url is not None else spec.key or provider.key
    return Access(provider.name, name, model, api, base_url, key)


def unusable(key: str | None, environ: Mapping[str, str]) -> str | None:
    """Why an agent with that variable for its key need not be started: it is set, and to nothing that is a key.

    One that is not set may be no fault: the program has its own words for it.
    """
    return credentials.complaint(key, environ) if key is not None and key in environ else None


def normalised(url: str, api: str) -> str:
    """A base URL as the clients of an API take it, with or without a version in it as it was written."""
    url = url.rstrip("/")
    if api in (CHAT, RESPONSES):
        return url if urlsplit(url).path else f"{url}/v1"
    for suffix in SUFFIXES:
        url = url.removesuffix(suffix)
    return url


HARNESS = "litellm"
APIS = (CHAT, ANTHROPIC, GEMINI)
OWN = {"anthropic": ANTHROPIC, "gemini": GEMINI}


@dataclass(frozen=True, slots=True)
class Route:
    """``model`` as litellm names it; ``base_url`` None: where litellm knows it to be; ``key`` names a variable."""

    model: str
    base_url: str | None
    key: str | None


def apis_for(model: str | None) -> tuple[str, ...]:
    """The APIs over which a model can be asked, its maker's own first: only there nothing gets lost."""
    own = OWN.get(split_model(model or "", HARNESS)[0].name, CHAT)
    return (own, *(api for api in APIS if api != own))


def route(spec: HarnessSpec, model: str | None, environ: Mapping[str, str]) -> Route | Diagnostic:
    """The route to ``model``, or what is missing.

    A provider that octoform does not know, and that has no URL in the manifest, is litellm's to find.
    """
    way = access(spec, model, apis_for(model), environ)
    if isinstance(way, Diagnostic):
        return way
    if "/" in way.model and way.model == way.named and spec.base_url is None:
        return Route(way.named, None, spec.key)
    return _named(way)


def _named(way: Access) -> Route:
    if way.api == ANTHROPIC:
        return Route(f"anthropic/{way.model}", way.base_url, way.key)
    if way.api == GEMINI:
        return Route(f"gemini/{way.model}", f"{way.base_url}/v1beta", way.key)
    if way.provider == "ollama":
        # Over its own API, since the other one cuts long conversations without a word.
        return Route(f"ollama_chat/{way.model}", way.base_url.removesuffix("/v1"), way.key)
    provider = "openai" if way.provider in OWN else way.provider
    return Route(f"{provider}/{way.model}", way.base_url, way.key)
