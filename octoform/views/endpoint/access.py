"""Tokens and the tunnel for a person and for a program; a value is shown only where it was asked for."""

from collections.abc import Sequence

from octoform.base.tokens import Token
from octoform.endpoint.access.tokens import Made
from octoform.endpoint.access.tunnel import Revocation
from octoform.engine.access import Shown
from octoform.views.format.console import Console
from octoform.views.format.output import document
from octoform.views.format.values import escape


def made(console: Console, found: Made, *, rotated: bool, as_json: bool) -> int:
    """A token with a new value."""
    token = found.token
    if as_json:
        return document(console, {"format": 1, **_facts(token), "value": found.value, "file": str(found.path)})
    what = "has a new value; the old one ended" if rotated else f"was made; it may call {', '.join(token.effects)}"
    console.line(f"The token {token.name} {what}." + (f" It ends {token.expires}." if token.expires else ""))
    console.line()
    console.raw(f"  {found.value}")
    console.line()
    console.line(f"It is kept in {escape(str(found.path))} (for this user alone); octoform token list never shows it.")
    return 0


def listed(console: Console, tokens: Sequence[Token], *, as_json: bool) -> int:
    """All tokens without their values."""
    if as_json:
        return document(console, {"format": 1, "tokens": [_facts(token) for token in tokens]})
    if not tokens:
        console.line("There are no tokens: nobody gets in over the network. octoform token create NAME makes one.")
        return 0
    width = max(len(token.name) for token in tokens)
    for token in tokens:
        ends = f"ends {token.expires}" if token.expires else "no end"
        mark = console.paint("ended", "red") if token.ended else ends
        console.line(f"{token.name:{width}}  {','.join(token.effects)}  made {token.created}  {mark}")
    return 0


def value(console: Console, name: str, found: Shown, *, as_json: bool) -> int:
    """The value alone, so that a script can take it."""
    if as_json:
        return document(console, {"format": 1, "name": name, "value": found.value, "file": str(found.path)})
    console.raw(found.value)
    return 0


def ended(console: Console, name: str, *, as_json: bool) -> int:
    """A token was revoked."""
    if as_json:
        return document(console, {"format": 1, "name": name, "revoked": True})
    console.line(f"The token {name} ended, and within a second all that it has open.")
    return 0


def revoked(console: Console, found: Revocation, *, as_json: bool) -> int:
    """The tunnel is proved to be gone."""
    if as_json:
        facts = {
            "proved": True,
            "was_running": found.was_running,
            "pid": found.pid,
            "url": found.url,
            "answered_before": found.answered_before,
        }
        return document(console, {"format": 1, **facts})
    if found.pid is None:
        console.line("No tunnel was open.")
    else:
        what = "was ended" if found.was_running else "was not running"
        console.line(f"The tunnel {what}: no process of it lives (pid {found.pid}).")
    if found.url is not None:
        console.line(f"{escape(found.url)} no longer answers as this endpoint.")
        if found.answered_before is False:
            console.line("It did not answer just before either; it was heard to while the tunnel was open.")
    console.line("It stays closed until octoform start.")
    return 0


def _facts(token: Token) -> dict[str, object]:
    return {
        "name": token.name,
        "effects": list(token.effects),
        "created": token.created,
        "expires": token.expires,
        "ended": token.ended,
    }
