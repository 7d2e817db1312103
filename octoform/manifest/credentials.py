"""Programs whose owner may be logged in (a subscription) instead of having a key: where their login lies.

Only the token that opens the service for some hours or days is taken, never the one that renews it: anyone who renews a
login makes every other copy of it void, so that the owner would be logged out. Light.

Whether a variable holds what can be a key at all, before anybody sends it. Light.
"""

from collections.abc import Iterator, Mapping

from octoform.patterns import regex
from octoform.records import dataclass
from octoform.redaction import found_in
from octoform.redaction.forms import KEY_BEGIN, KEY_END


def complaint(name: str, environ: Mapping[str, str]) -> str | None:
    """The problem of the variable of a key, never with its value in it; None when a request can carry it."""
    if name not in environ:
        return f"the variable {name} is not set"
    value = environ[name]
    if not value.strip():
        return f"the variable {name} is empty"
    if "\n" in value or "\r" in value:
        return f"the variable {name} holds a line break, which no key has"
    return None if is_sendable(value) else f"the variable {name} holds blanks or characters that no request can carry"


def is_sendable(key: str) -> bool:
    """True when each character may be in the header of a request."""
    return all("!" <= character <= "~" for character in key)


@dataclass(frozen=True, slots=True)
class Login:
    """One program's login.

    ``variable`` is the one that its agent finds the token in; its owner may set it as well. ``file`` is where the
    program keeps its login, below the folder that the variable ``folder`` names or else below ``home`` in the owner's
    home. ``token`` and ``until`` are the names on the way to the token and to its end in milliseconds since 1970 (None:
    the token is a JWT that states that itself, RFC 7519); ``account`` likewise, for a program that sends it along, as
    the variable ``account_variable``. ``url`` is where the API of such an account is, None: the provider's own.
    ``renew`` states how its owner renews it.
    """

    provider: str
    variable: str
    folder: str
    home: str
    file: str
    token: tuple[str, ...]
    until: tuple[str, ...] | None
    renew: str
    url: str | None = None
    account: tuple[str, ...] = ()
    account_variable: str | None = None


LOGINS: Mapping[str, Login] = {
    "claude-code": Login(
        provider="anthropic",
        variable="CLAUDE_CODE_OAUTH_TOKEN",
        folder="CLAUDE_CONFIG_DIR",
        home=".claude",
        file=".credentials.json",
        token=("claudeAiOauth", "accessToken"),
        until=("claudeAiOauth", "expiresAt"),
        renew="start `claude` once and log in there, or export CLAUDE_CODE_OAUTH_TOKEN from `claude setup-token`",
    ),
    "codex": Login(
        provider="openai",
        variable="CODEX_ACCESS_TOKEN",
        folder="CODEX_HOME",
        home=".codex",
        file="auth.json",
        token=("tokens", "access_token"),
        until=None,
        renew="run `codex login`",
        url="https://chatgpt.com/backend-api/codex",
        account=("tokens", "account_id"),
        account_variable="CODEX_ACCOUNT_ID",
    ),
}


# Who serves models: how a model is named, which variable holds the key, and which APIs are where.
#
# A model is named ``provider/name`` (``anthropic/claude-sonnet-4-5``, ``openrouter/google/gemini-3-flash-preview``); a
# name without a known provider belongs to the one whose models the harness uses by itself. The URLs and variables are
# those that the providers' own documentation gives. Light.

CHAT, RESPONSES, ANTHROPIC, GEMINI = "openai-completions", "openai-responses", "anthropic-messages", "gemini"
APIS = (CHAT, RESPONSES, ANTHROPIC, GEMINI)


@dataclass(frozen=True, slots=True)
class Provider:
    """A provider of models: the variable with the key (None: needs none), and a base URL for each of its APIs."""

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
"""The provider that a bare model name means, by harness; for all others OpenAI's."""
SPOKEN = {"claude-code": (ANTHROPIC,), "codex": (RESPONSES,), "gemini-cli": (GEMINI,)}
"""The APIs of models that a program speaks, where these are not all."""
SEARCHERS = ("claude-code", "codex", "gemini-cli", "litellm", "opencode", "qwen-code")
"""The harnesses whose agents can search the web, by themselves or through their model."""


def split_model(model: str, harness: str) -> tuple[Provider, str]:
    """The provider and the name that it knows the model by."""
    first, _, rest = model.partition("/")
    found = PROVIDERS.get(ALIASES.get(first, first)) if rest else None
    return (found, rest) if found is not None else (PROVIDERS[NATIVE.get(harness, "openai")], model)


# What looks like a secret, and how it is kept out of every message.
#
# A manifest is in git, so a literal credential in it is already a leak; the message about it must not be a second
# one. Beside what shows by its form that it is a secret (`octoform.redaction`) it is any literal under a key or behind
# an option whose name marks it as one.

__all__ = ["assigned_in", "found_in", "is_secret_name", "key_blocks", "masked"]

_WORD = r"(?:(?:api|access|secret|private)[-_]?keys?|(?:auth[-_]?)?token|secrets?|pass(?:word|wd|phrase)|credentials?)"
_SECRET_NAME = regex(rf"(?i)(?:^|.*[-_.]|-*){_WORD}")
_ASSIGNMENT = regex(rf"(?i)(?<![A-Za-z]){_WORD}['\"]?\s*[=:]\s*['\"]?(?!\$)([^\s'\",}}\]]{{6,}})")
_KEY_BEGINS = regex(KEY_BEGIN.source())
_KEY_ENDS = regex(KEY_END.source())


def assigned_in(text: str) -> list[tuple[int, int]]:
    """Where a literal is given to a secret's name inside a string (``--api-key=...``): (start, end) offsets."""
    return [found.span(1) for found in _ASSIGNMENT.finditer(text)]


def is_secret_name(name: str) -> bool:
    """True for the name of a key or an option whose value is a secret (``api_key``, ``--token``)."""
    return _SECRET_NAME.fullmatch(name) is not None


def masked(text: str) -> str:
    """The text with everything that looks like a secret replaced by asterisks of the same length."""
    for start, end in (*found_in(text), *assigned_in(text)):
        text = text[:start] + "*" * (end - start) + text[end:]
    return text


def key_blocks(lines: list[str]) -> Iterator[tuple[int, int]]:
    """The lines of private keys as (first, last) indexes; a key that never ends reaches to the end of the file."""
    first: int | None = None
    for number, line in enumerate(lines):
        if first is None and _KEY_BEGINS.search(line):
            first = number
        if first is not None and _KEY_ENDS.search(line):
            yield first, number
            first = None
    if first is not None:
        yield first, len(lines) - 1
