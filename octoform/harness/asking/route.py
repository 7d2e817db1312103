"""The way to a model in litellm's words: its name there, where it is, and the variable with the key.

litellm reads the API off the beginning of a name, and takes the base URL of each API in another form than the API's
own clients do. All of that is settled here, without the library.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from octoform.diagnostics import Diagnostic
from octoform.harness.access import Access, access
from octoform.manifest.credentials import ANTHROPIC, CHAT, GEMINI, split_model
from octoform.manifest.model import HarnessSpec

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
