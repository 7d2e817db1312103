"""Programs whose owner may be logged in (a subscription) instead of having a key: where their login lies.

Only the token that opens the service for some hours or days is taken, never the one that renews it: whoever renews a
login makes every other copy of it void, so that the owner would be logged out. Light.

Whether a variable holds what can be a key at all, before anybody sends it. Light.
"""

from collections.abc import Mapping
from dataclasses import dataclass


def complaint(name: str, environ: Mapping[str, str]) -> str | None:
    """What is wrong with the variable of a key, never with its value in it; None when a request can carry it."""
    if name not in environ:
        return f"the variable {name} is not set"
    value = environ[name]
    if not value.strip():
        return f"the variable {name} is empty"
    if "\n" in value or "\r" in value:
        return f"the variable {name} holds a line break, which no key has"
    return None if is_sendable(value) else f"the variable {name} holds blanks or characters that no request can carry"


def is_sendable(key: str) -> bool:
    """True when each character may stand in the header of a request."""
    return all("!" <= character <= "~" for character in key)


@dataclass(frozen=True, slots=True)
class Login:
    """One program's login.

    ``variable`` is the one that its agent finds the token in; its owner may set it as well. ``file`` is where the
    program keeps its login, below the folder that the variable ``folder`` names or else below ``home`` in the owner's
    home. ``token`` and ``until`` are the names on the way to the token and to its end in milliseconds since 1970 (None:
    the token is a JWT that says so itself, RFC 7519); ``account`` likewise, for a program that sends it along, as the
    variable ``account_variable``. ``url`` is where the API of such an account is, None: the provider's own. ``renew``
    says how its owner renews it.
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
