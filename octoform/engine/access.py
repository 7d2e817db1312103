"""Tokens and the tunnel, for the host of a project folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from octoform.base.tokens import Token
from octoform.diagnostics import Diagnostic
from octoform.endpoint.access import tokens
from octoform.endpoint.access.tokens import Made
from octoform.endpoint.access.tunnel import Revocation
from octoform.endpoint.access.tunnel import revoke as end_tunnel
from octoform.engine.safety import person
from octoform.engine.tools import layout_of

Environ = Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Shown:
    """A token's value and the private file that keeps it."""

    value: str
    path: Path


def create_token(
    project: Path, environ: Environ, name: str, effects: Sequence[str], seconds: float | None
) -> tuple[Made | None, list[Diagnostic]]:
    """Make a token."""
    layout, found = layout_of(project, environ)
    return (None, found) if layout is None else tokens.create(layout, name, effects, seconds, person())


def list_tokens(project: Path, environ: Environ) -> tuple[tuple[Token, ...] | None, list[Diagnostic]]:
    """All tokens, without values."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    listed, found = tokens.listed(layout)
    return (None, found) if found else (listed, [])


def show_token(project: Path, environ: Environ, name: str) -> tuple[Shown | None, list[Diagnostic]]:
    """The value of a token."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    value, found = tokens.value_of(layout, name)
    return (None, found) if value is None else (Shown(value, tokens.path_of(layout, name)), [])


def rotate_token(project: Path, environ: Environ, name: str) -> tuple[Made | None, list[Diagnostic]]:
    """Give a token a new value."""
    layout, found = layout_of(project, environ)
    return (None, found) if layout is None else tokens.rotate(layout, name, person())


def revoke_token(project: Path, environ: Environ, name: str) -> list[Diagnostic]:
    """End a token."""
    layout, found = layout_of(project, environ)
    return found if layout is None else tokens.revoke(layout, name, person())


def revoke_tunnel(project: Path, environ: Environ) -> tuple[Revocation | None, list[Diagnostic]]:
    """End the tunnel, and find proof that it is gone."""
    layout, found = layout_of(project, environ)
    return (None, found) if layout is None else end_tunnel(layout, person())
