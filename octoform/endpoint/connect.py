"""From a client's stdio to the endpoint of a host, started first where nothing runs yet. Light."""

from pathlib import Path

from octoform.diagnostics import Diagnostic
from octoform.endpoint.dial import reach
from octoform.endpoint.published_files import LAUNCHER
from octoform.endpoint.stdio import Again, pipe, refuse
from octoform.manifest.model_url import is_legal_host
from octoform.state.files import foreign_among
from octoform.state.layout import Layout


def connect(project: Path, host: str | None, *, revive: bool = False) -> str | None:
    """Carry a client's bytes until it is done; the reason in one line when it ended otherwise.

    A client that is refused is told so in an answer to its first request too. ``revive``: it may end a person's stop.
    """
    layout = _layout(project, host)
    if isinstance(layout, str):
        return _refused(layout)
    connection = reach(layout, revive=revive)
    if isinstance(connection, Diagnostic):
        hint = connection.hint if connection.code == "ENDPOINT-STOPPED" else None
        return _refused(": ".join(filter(None, (connection.summary, connection.detail, hint))))
    with connection:
        return None if pipe(connection, again=lambda: _again(layout)) else f"the endpoint of {layout.host} was stopped"


def _refused(why: str) -> str:
    refuse(why)
    return why


def _again(layout: Layout) -> Again:
    from octoform.endpoint.dial import Returning  # here, since few pipes ever need it

    return Returning(layout)


def _layout(project: Path, host: str | None) -> Layout | str:
    """The host that is meant, or why none is."""
    if host is not None and not is_legal_host(host):
        return f"{host!r} is no name of a host"
    applied = sorted(path.parents[1].name for path in project.glob(f".octoform/*/endpoint/{LAUNCHER}"))
    if host in applied:
        return Layout(project, host)
    if host is None and len(applied) == 1:
        return Layout(project, applied[0])
    if (host is not None or not applied) and (shut := foreign_among(project, host)):
        return shut.summary
    if host is not None:
        return f"{host} has no endpoint in {project}; run octoform apply"
    known = f"; name one: {', '.join(applied)}" if applied else "; run octoform apply"
    return f"{project} has {len(applied) or 'no'} endpoint{'s' if len(applied) > 1 else ''}{known}"
