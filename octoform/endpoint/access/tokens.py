"""Network access to the endpoint: named tokens, each with the tools that it may call.

The process that serves reads the digests (`tokens.json`) before each request, so a change counts at once. Values are
kept beside it, one private file each, because a client's configuration points to them; only what is asked for a value
shows one. Each change is a record of the audit log: a new way in is made only when that is written, and one is closed
in any case. Light.
"""

import contextlib
import hashlib
import secrets
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

from octoform.base import clock, files
from octoform.base.files import private_folder
from octoform.base.locks import held
from octoform.base.tokens import NAME, Token, encoded, read
from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.endpoint.process import offline_commands
from octoform.records import dataclass
from octoform.state.files import write_atomic
from octoform.state.layout import Layout

RECORD = "tokens.json"
VALUES = "tokens"
DEFAULT = "default"
APPLY = "octoform apply"
"""The recorded creator of the first token."""
EFFECTS = ("read", "actuate", "irreversible")
PREFIX = "octoform_"
"""Begins every value, so that the finder of one knows what it opens."""
_LOCK = "tokens.lock"
MAX_VALUE_BYTES = 4096


@dataclass(frozen=True, slots=True)
class Made:
    """A token whose value is new: to be shown once."""

    token: Token
    value: str
    path: Path


def path_of(layout: Layout, name: str) -> Path:
    """The private file that keeps the value of a token."""
    return layout.run / VALUES / name


def ensure_default(layout: Layout) -> list[Diagnostic]:
    """Make the first token, ``default``, which may call everything; nothing where there were tokens before."""
    if (layout.run / RECORD).exists():
        return []
    return create(layout, DEFAULT, EFFECTS, None)[1]


def listed(layout: Layout) -> tuple[tuple[Token, ...], list[Diagnostic]]:
    """All tokens by name, without their values."""
    try:
        tokens = read(layout.run / RECORD)
    except FileNotFoundError:
        return (), []
    except (OSError, ValueError) as problem:
        return (), [_damaged(layout, problem)]
    return tuple(sorted(tokens, key=lambda token: token.name)), []


def create(
    layout: Layout, name: str, effects: Sequence[str], seconds: float | None, by: str = APPLY
) -> tuple[Made | None, list[Diagnostic]]:
    """Make a token that may call tools of ``effects`` and ends after ``seconds`` (None: never); ``by`` did so."""
    found = _wrong(name, effects)
    if found:
        return None, found
    with _alone(layout):
        tokens, found = listed(layout)
        if found:
            return None, found
        if any(token.name == name for token in tokens):
            hint = f"octoform token rotate {name} gives it a new value; octoform token revoke {name} ends it"
            return None, [error("TOKEN-EXISTS", f"there is a token {name!r} already", hint=hint)]
        now = datetime.now(UTC)
        ends = None if seconds is None else clock.stamp(now + timedelta(seconds=seconds))
        ordered = tuple(effect for effect in EFFECTS if effect in effects)
        token = Token(name, "", ordered, clock.stamp(now), ends)
        refused = _recorded(layout, "token_created", token, by)
        return (None, [refused]) if refused is not None else _keep(layout, tokens, token)


def rotate(layout: Layout, name: str, by: str) -> tuple[Made | None, list[Diagnostic]]:
    """Give a token a new value; the old one ends, with all that it has open. Name, effects and end stay."""
    with _alone(layout):
        tokens, found = listed(layout)
        known = {token.name: token for token in tokens}
        if found or name not in known:
            return None, found or [_unknown(name, tokens)]
        if known[name].ended:
            hint = f"octoform token revoke {name}, then octoform token create {name}"
            return None, [error("TOKEN-ENDED", f"the token {name!r} ended {known[name].expires}", hint=hint)]
        refused = _recorded(layout, "token_rotated", known[name], by)
        if refused is not None:
            return None, [refused]
        return _keep(layout, [token for token in tokens if token.name != name], known[name])


def revoke(layout: Layout, name: str, by: str) -> list[Diagnostic]:
    """End a token, with all that it has open; a warning when only the record of it could not be written."""
    with _alone(layout):
        tokens, found = listed(layout)
        known = {token.name: token for token in tokens}
        if found or name not in known:
            return found or [_unknown(name, tokens)]
        refused = _write(layout, [token for token in tokens if token.name != name])
        if refused is not None:
            return [refused]
        path_of(layout, name).unlink(missing_ok=True)
        unwritten = _recorded(layout, "token_revoked", known[name], by)
        return [] if unwritten is None else [warning(unwritten.code, unwritten.summary, detail=unwritten.detail)]


def value_of(layout: Layout, name: str) -> tuple[str | None, list[Diagnostic]]:
    """The value of a token."""
    tokens, found = listed(layout)
    if found or all(token.name != name for token in tokens):
        return None, found or [_unknown(name, tokens)]
    reason = "this is not the value that was made for it"
    try:
        value = files.read(path_of(layout, name), MAX_VALUE_BYTES, follow=False).strip()
    except (OSError, ValueError) as problem:
        value, reason = b"", _reason(problem)
    if any(token.name == name and token.sha256 == hashlib.sha256(value).hexdigest() for token in tokens):
        return value.decode(), []
    hint = f"octoform token rotate {name} gives it a new one"
    text = f"the value of the token {name!r} cannot be read"
    return None, [error("TOKEN-VALUE-GONE", text, detail=reason, path=str(path_of(layout, name)), hint=hint)]


def kept_values(layout: Layout) -> dict[str, str]:
    """The content of the files of values, by name, as far as readable: to be found in strings, not to be shown."""
    found = {}
    folder = layout.run / VALUES
    for path in sorted(folder.glob("*")) if folder.is_dir() else ():
        with contextlib.suppress(OSError, ValueError):
            found[path.name] = files.read(path, MAX_VALUE_BYTES, follow=False).decode().strip()
    return {name: value for name, value in found.items() if value}


@contextlib.contextmanager
def _alone(layout: Layout) -> Iterator[None]:
    """Only one change at a time."""
    private_folder(layout.run)
    with held(layout.run / _LOCK):
        yield


def _recorded(layout: Layout, event: str, token: Token, by: str) -> Diagnostic | None:
    """Write into the audit log what is done to a token, whether a process runs or not."""
    fields = {"token": token.name, "effects": list(token.effects), "expires": token.expires, "by": by}
    answer = offline_commands.ask(layout, "note", {"event": event, **fields})
    if answer["ok"]:
        return None
    text = f"the audit log has no record of what was done to the token {token.name!r}"
    hint = "nothing was changed; octoform audit -verify checks the log"
    return error("TOKEN-NOT-RECORDED", text, detail="; ".join(map(str, answer["problems"])), hint=hint)


def _keep(layout: Layout, others: Sequence[Token], token: Token) -> tuple[Made | None, list[Diagnostic]]:
    """Give ``token`` a value; the value is on the disk before it opens anything."""
    value = PREFIX + secrets.token_urlsafe(32)
    digest = hashlib.sha256(value.encode()).hexdigest()
    kept = Token(token.name, digest, token.effects, token.created, token.expires)
    path = path_of(layout, token.name)
    private_folder(path.parent)
    refused = write_atomic(path, value.encode() + b"\n", 0o600) or _write(layout, [*others, kept])
    return (None, [refused]) if refused is not None else (Made(kept, value, path), [])


def _write(layout: Layout, tokens: Sequence[Token]) -> Diagnostic | None:
    return write_atomic(layout.run / RECORD, encoded(tokens), 0o600)


def _wrong(name: str, effects: Sequence[str]) -> list[Diagnostic]:
    found = []
    if not NAME.fullmatch(name):
        hint = "letters, digits, '.', '_' and '-', at most 64, the first one a letter or digit"
        found.append(error("TOKEN-BAD-NAME", f"{name!r} cannot be the name of a token", hint=hint))
    unknown = [effect for effect in effects if effect not in EFFECTS]
    if unknown or not effects:
        text = f"{unknown[0]!r} is no effect" if unknown else "a token must have an effect"
        meant = _meant(unknown[0], EFFECTS) if unknown else None
        found.append(error("TOKEN-BAD-EFFECT", text, hint=meant or f"effects are {', '.join(EFFECTS)}"))
    return found


def _unknown(name: str, tokens: Sequence[Token]) -> Diagnostic:
    names = [token.name for token in tokens]
    hint = _meant(name, names) or (f"there are {', '.join(names)}" if names else "there are none")
    return error("TOKEN-UNKNOWN", f"there is no token {name!r}", hint=hint)


def _meant(word: str, known: Sequence[str]) -> str | None:
    guess = did_you_mean(word, known)
    return None if guess is None else f"did you mean {guess!r}?"


def _damaged(layout: Layout, problem: Exception) -> Diagnostic:
    hint = "no one gets in with a token now; remove the file and make the tokens again with octoform token create"
    path = str(layout.run / RECORD)
    return error("TOKEN-FILE", "the tokens cannot be read", detail=_reason(problem), path=path, hint=hint)


def _reason(problem: Exception) -> str:
    return (problem.strerror if isinstance(problem, OSError) else None) or str(problem)
