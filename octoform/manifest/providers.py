"""Who serves models: how a model is named, which variable holds the key, and which APIs are where.

A model is named ``provider/name`` (``anthropic/claude-sonnet-4-5``, ``openrouter/google/gemini-3-flash-preview``); a
name without a known provider belongs to the one whose models the harness uses by itself. The URLs and variables are
those that the providers' own documentation gives. Light.
"""

from collections.abc import Mapping
from dataclasses import dataclass

CHAT, RESPONSES, ANTHROPIC, GEMINI = "openai-completions", "openai-responses", "anthropic-messages", "gemini"
APIS = (CHAT, RESPONSES, ANTHROPIC, GEMINI)


@dataclass(frozen=True, slots=True)
class Provider:
    """Who serves models: the variable with the key (None: needs none), and a base URL for each API that it speaks."""

    name: str
    key: str | None
    urls: Mapping[str, str]


PROVIDERS: Mapping[str, Provider] = {
    item.name: item
    for item in (
        Provider("anthropic", "ANTHROPIC_API_KEY", {ANTHROPIC: "https://api.anthropic.com"}),
        Provider(
            "openai",
            "OPENAI_API_KEY",
            {CHAT: "https://api.openai.com/v1", RESPONSES: "https://api.openai.com/v1"},
        ),
        Provider(
            "openrouter",
            "OPENROUTER_API_KEY",
            {
                CHAT: "https://openrouter.ai/api/v1",
                RESPONSES: "https://openrouter.ai/api/v1",
                ANTHROPIC: "https://openrouter.ai/api",
            },
        ),
        Provider("gemini", "GEMINI_API_KEY", {GEMINI: "https://generativelanguage.googleapis.com"}),
        Provider("deepseek", "DEEPSEEK_API_KEY", {CHAT: "https://api.deepseek.com/v1"}),
        Provider("mistral", "MISTRAL_API_KEY", {CHAT: "https://api.mistral.ai/v1"}),
        Provider("groq", "GROQ_API_KEY", {CHAT: "https://api.groq.com/openai/v1"}),
        Provider("xai", "XAI_API_KEY", {CHAT: "https://api.x.ai/v1", RESPONSES: "https://api.x.ai/v1"}),
        Provider("ollama", None, {CHAT: "http://127.0.0.1:11434/v1", RESPONSES: "http://127.0.0.1:11434/v1"}),
    )
}
ALIASES = {"google": "gemini", "ollama_chat": "ollama"}
NATIVE = {"claude-code": "anthropic", "gemini-cli": "gemini"}
"""Whose models a bare name means, by harness; for all others OpenAI's."""
SEARCHERS = ("claude-code", "codex", "gemini-cli", "litellm", "opencode", "qwen-code")
"""The harnesses whose agents can search the web, by themselves or through their model."""


def split(model: str, harness: str) -> tuple[Provider, str]:
    """The provider and the name that it knows the model by."""
    first, _, rest = model.partition("/")
    found = PROVIDERS.get(ALIASES.get(first, first)) if rest else None
    return (found, rest) if found is not None else (PROVIDERS[NATIVE.get(harness, "openai")], model)
