"""Emergency stop, audit log and limits for a person in a project folder."""

import os
import pwd
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from octoform.base.tokens import Token
from octoform.diagnostics import Diagnostic, error
from octoform.endpoint.access import audit_log, tokens
from octoform.endpoint.access import limits as endpoint_limits
from octoform.endpoint.access.audit_log import Checked, Wanted
from octoform.endpoint.access.limits import Limits
from octoform.endpoint.access.tokens import Made
from octoform.endpoint.access.tunnel import Revocation
from octoform.endpoint.access.tunnel import revoke as end_tunnel
from octoform.endpoint.process import estop
from octoform.endpoint.process.estop import Estop
from octoform.engine.tools import layout_of
from octoform.records import dataclass
from octoform.state.files import foreign_among
from octoform.state.layout import Layout

Environ = Mapping[str, str]


def stop(project: Path, reason: str) -> tuple[list[Estop], list[Diagnostic]]:
    """Stop every endpoint of this folder: whose manifest cannot be read has devices that move all the same.

    From a folder inside of a project that is the project; no one has the time to look for its top.
    """
    return _each(_nearest(project), lambda layout: estop.stop(layout, person(), reason))


def clear(project: Path) -> tuple[list[Estop], list[Diagnostic]]:
    """Let the actuators of every endpoint of exactly this folder be called again."""
    return _each(project, lambda layout: estop.clear(layout, person()))


def records(
    project: Path, environ: Environ, count: int, wanted: Wanted
) -> tuple[list[dict[str, Any]] | None, list[Diagnostic]]:
    """The latest records of the audit log that are wanted."""
    layout, found = _layout(project, environ)
    if layout is None:
        return None, found
    latest, found = audit_log.latest(layout, count, wanted)
    return (None, found) if found else (latest, [])


def check_records(project: Path, environ: Environ) -> tuple[Checked | None, list[Diagnostic]]:
    """Whether the audit log is as it was written."""
    layout, found = _layout(project, environ)
    return (None, found) if layout is None else audit_log.verify(layout)


def limits(project: Path, environ: Environ) -> tuple[Limits | None, list[Diagnostic]]:
    """The limits and what is used of them."""
    layout, found = _layout(project, environ)
    return (None, found) if layout is None else endpoint_limits.show(layout)


def reset_limits(project: Path, environ: Environ, tool: str) -> list[Diagnostic]:
    """Forget what was counted for a tool, or for ``all``."""
    layout, found = _layout(project, environ)
    return found if layout is None else endpoint_limits.reset(layout, tool, person())


def person() -> str:
    """The user at the terminal, for the audit log."""
    try:
        return f"{pwd.getpwuid(os.getuid()).pw_name} at the terminal"
    except KeyError:  # a user id without a name, as in containers
        return f"user {os.getuid()} at the terminal"


def _each(project: Path, do: Callable[[Layout], Estop]) -> tuple[list[Estop], list[Diagnostic]]:
    """The result for each endpoint; a problem where there is none, or one that this user may not see."""
    layouts = _layouts(project)
    shut = foreign_among(project)
    found = [shut] if shut else []
    if not layouts:
        return [], found or [_nothing(project)]
    with ThreadPoolExecutor(len(layouts)) as pool:
        return [item.result() if isinstance(item, Future) else item for item in _submitted(pool, do, layouts)], found


def _submitted(
    pool: ThreadPoolExecutor, do: Callable[[Layout], Estop], layouts: list[Layout]
) -> list[Future[Estop] | Estop]:
    """All at once; where the system gives no more threads, one after the other in this one."""
    done: list[Future[Estop] | Estop] = []
    for layout in layouts:
        try:
            done.append(pool.submit(do, layout))
        except RuntimeError:
            done.append(do(layout))
    return done


def _layouts(project: Path) -> list[Layout]:
    return [Layout(project, path.parent.name) for path in sorted((project / ".octoform").glob("*/endpoint"))]


def _nearest(folder: Path) -> Path:
    """The folder, or the nearest one above it, that has an endpoint; the folder itself where none has."""
    above = (place for place in (folder, *folder.parents) if _layouts(place) or foreign_among(place))
    return next(above, folder)


def _nothing(project: Path) -> Diagnostic:
    hint = "go to the folder of octopus.yaml, or name it with -chdir"
    place = _nearest(project)
    if place != project:
        hint = f"the project is {place}: octoform -chdir={place} estop -clear"
    return error("ENDPOINT-NOT-APPLIED", "there is no endpoint in this folder", path=str(project), hint=hint)


def _layout(project: Path, environ: Environ) -> tuple[Layout | None, list[Diagnostic]]:
    from octoform.engine.tools import layout_of  # an emergency stop does not wait for what this imports

    return layout_of(project, environ)


# Tokens and the tunnel, for the host of a project folder.


@dataclass(frozen=True, slots=True)
class TokenValue:
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


def show_token(project: Path, environ: Environ, name: str) -> tuple[TokenValue | None, list[Diagnostic]]:
    """The value of a token."""
    layout, found = layout_of(project, environ)
    if layout is None:
        return None, found
    value, found = tokens.value_of(layout, name)
    return (None, found) if value is None else (TokenValue(value, tokens.path_of(layout, name)), [])


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
