"""The caller of a tool, which decides what the call may do.

A client of the Unix socket is this machine's own user and may do everything that the policy allows. Anyone who
comes over HTTP is the token of *this* request: a session keeps the context of the request that opened it, so that
context is asked last. A request over HTTP without a token never counts as local.
"""

from dataclasses import dataclass
from typing import Literal

from fastmcp.server.dependencies import get_access_token, get_http_request
from mcp.server.auth.middleware.bearer_auth import AuthenticatedUser

EFFECTS = frozenset({"read", "actuate", "irreversible"})


@dataclass(frozen=True, slots=True)
class Principal:
    """A caller: the name of its token (``local`` for this machine's user) and the effect classes that it may call."""

    name: str
    effects: frozenset[str]
    transport: Literal["unix", "http"]


LOCAL = Principal("local", EFFECTS, "unix")
NOBODY = Principal("nobody", frozenset(), "http")


def current() -> Principal:
    """The caller of the request that is being answered; LOCAL outside of any HTTP request."""
    try:
        user = get_http_request().scope.get("user")
    except RuntimeError:
        token = get_access_token()
        return LOCAL if token is None else Principal(token.client_id, frozenset(token.scopes), "http")
    if not isinstance(user, AuthenticatedUser):
        return NOBODY
    return Principal(user.access_token.client_id, frozenset(user.access_token.scopes), "http")
