"""The logins of the person who runs octoform, for agents whose manifest has `login: true`."""

import base64
import binascii
import time
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Any

from octoform.base.files import parse, read_json
from octoform.diagnostics import Diagnostic, error
from octoform.manifest.credentials import LOGINS, Login, is_sendable
from octoform.manifest.model import STEP, HarnessSpec, Manifest
from octoform.records import dataclass

MAX_BYTES = 1 << 20
LEAST_SECONDS = 600.0
"""A token that ends sooner is none to start with."""


@dataclass(frozen=True, slots=True)
class Found:
    """A login that can be used: its variables, where it was found, and when it ends (seconds since 1970, if known)."""

    variables: Mapping[str, str]
    place: str
    until: float | None


def variables(manifest: Manifest, environ: Mapping[str, str]) -> dict[str, str]:
    """The variables of the person's logins that the manifest's agents need; empty where none can be used."""
    found = [find(spec, environ) for spec in _specs(manifest) if spec.login]
    return {name: value for each in found if isinstance(each, Found) for name, value in each.variables.items()}


def problems(manifest: Manifest, environ: Mapping[str, str], nodes: Collection[str] | None = None) -> list[Diagnostic]:
    """HARNESS-LOGIN for every program whose login is to be used, and there is none that can be.

    With ``nodes`` only for the agents of these stages and steps.
    """
    asked = {spec.name: spec for spec in _specs(manifest, nodes) if spec.login}
    return [each for spec in asked.values() if isinstance(each := find(spec, environ), Diagnostic)]


def _specs(manifest: Manifest, nodes: Collection[str] | None = None) -> Iterator[HarnessSpec]:
    settings = [*manifest.stages.items(), *manifest.keepers.items()]
    if manifest.step is not None:
        settings += [(f"{STEP}{each.name}", manifest.step) for each in manifest.privileged_steps]
    for name, each in settings:
        if nodes is None or name in nodes:
            yield each.harness
            if each.escalate is not None:
                yield each.escalate.harness


def find(spec: HarnessSpec, environ: Mapping[str, str], now: float | None = None) -> Found | Diagnostic:
    """The login of the person for that program: the variable, if it is set, else what the program keeps."""
    login = LOGINS[spec.name]
    if environ.get(login.variable):
        return Found({}, login.variable, None)
    path = _path(login, environ)
    try:
        document = read_json(path, MAX_BYTES)
    except FileNotFoundError:
        return _refused(spec, f"there is no {path}", login)
    except (OSError, ValueError) as problem:
        return _refused(spec, f"{path} cannot be read ({getattr(problem, 'strerror', None) or problem})", login)
    token = _at(document, login.token)
    if not isinstance(token, str) or not token or not is_sendable(token):
        return _refused(spec, f"{path} holds no login", login)
    until = _until(document, token, login)
    if until is not None and until - (time.time() if now is None else now) < LEAST_SECONDS:
        return _refused(spec, f"the login in {path} has ended, or ends within ten minutes", login)
    account = _at(document, login.account) if login.account else None
    given = {login.variable: token}
    if login.account_variable is not None and isinstance(account, str) and is_sendable(account):
        given[login.account_variable] = account
    return Found(given, str(path), until)


def _path(login: Login, environ: Mapping[str, str]) -> Path:
    folder = environ.get(login.folder)
    return Path(folder) / login.file if folder else Path(environ.get("HOME") or "/", login.home, login.file)


def _at(value: Any, names: tuple[str, ...]) -> Any:
    for name in names:
        value = value.get(name) if isinstance(value, dict) else None
    return value


def _until(document: Any, token: str, login: Login) -> float | None:
    """When the token ends, in seconds since 1970; None where no one states that."""
    if login.until is not None:
        milliseconds = _at(document, login.until)
        return milliseconds / 1000 if isinstance(milliseconds, int | float) else None
    words = token.split(".")
    try:
        claims = parse(base64.urlsafe_b64decode(words[1] + "=" * (-len(words[1]) % 4)))
    except (ValueError, IndexError, binascii.Error):
        return None
    end = _at(claims, ("exp",))
    return float(end) if isinstance(end, int | float) else None


def _refused(spec: HarnessSpec, why: str, login: Login) -> Diagnostic:
    summary = f"{spec.name} is to use your login, and {why}"
    return error("HARNESS-LOGIN", summary, hint=f"{login.renew}; or take `login` out and use a key")
