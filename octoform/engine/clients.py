"""MCP clients of this machine: what each needs to reach this host's endpoint, printed or put into its own file.

Which transport a client gets follows the scope: its own process over stdio where the endpoint has no network, HTTP
where it has one that is known; the caller's word goes before both.
"""

import sys
from collections.abc import Mapping
from pathlib import Path

from octoform.diagnostics import Diagnostic, did_you_mean, error, warning
from octoform.endpoint.access import tokens
from octoform.endpoint.access import tunnel as external_address
from octoform.endpoint.mcp_clients import install as client_install
from octoform.endpoint.mcp_clients import known_clients, merge
from octoform.endpoint.mcp_clients.install import ClientState, Outcome, Reach, Server
from octoform.endpoint.mcp_clients.known_clients import CLIENTS, Client, Surroundings
from octoform.endpoint.process.record import running
from octoform.endpoint.publication import client_command, lasting_client_command
from octoform.engine.plan import memo
from octoform.engine.plan.configuration import compile_project
from octoform.records import dataclass, replace
from octoform.state.files import foreign
from octoform.state.layout import Layout

STDIO, HTTP = "stdio", "http"
TRANSPORTS = (STDIO, HTTP)


@dataclass(frozen=True, slots=True)
class Printed:
    """A client's configuration as text, the file it belongs in, and what a person has to know with it."""

    client: Client
    file: Path
    text: str
    transport: str
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Listing:
    """Every client, as it is seen on this machine."""

    host: str
    sights: tuple[ClientState, ...]


def printed(
    project: Path, environ: Mapping[str, str], client: str, host: str | None = None, transport: str | None = None
) -> tuple[Printed | None, list[Diagnostic]]:
    """The configuration for a client; nothing is written, and no token's value is in it."""
    chosen, layout, found = _chosen(project, environ, client, host)
    if chosen is None or layout is None:
        return None, found
    server, more = _server(layout, chosen, transport)
    if server is None:
        return None, [*found, *more]
    server, result = _outward(layout, replace(server, bearer=None))
    entry = known_clients.form(chosen, server.name, server.command, server.url)
    assert entry is not None
    wish = merge.Wish(chosen.table, server.name, entry, prompted=server.url is not None)
    notes = () if server.url is None else (*result, *_token_notes(chosen))
    file = client_install.file_of(chosen, _around(environ))
    kind = STDIO if server.url is None else HTTP
    return Printed(chosen, file, merge.written(chosen, wish), kind, notes), found


def listed(project: Path, environ: Mapping[str, str]) -> tuple[Listing | None, list[Diagnostic]]:
    """All clients, their files, and whether this host's endpoint is in them; nothing is written."""
    layout, found = _layout(project, environ, None)
    if layout is None:
        return None, found
    return Listing(layout.host, _states(layout, environ)), found


def left_behind(layout: Layout, environ: Mapping[str, str]) -> list[Diagnostic]:
    """CLIENT-ENTRY-LEFT for each client that would still start or call the endpoint of a host that is destroyed."""
    return [
        warning(
            "CLIENT-ENTRY-LEFT",
            f"{sight.client.title} still has {_name(layout)}, which leads nowhere now",
            path=str(sight.file),
            hint=f"octoform clients remove {sight.client.key} takes it out",
        )
        for sight in _states(layout, environ)
        if sight.state == "installed"
    ]


def _states(layout: Layout, environ: Mapping[str, str]) -> tuple[ClientState, ...]:
    url, tunnel = _url(layout), external_address.tunnel_now(layout)
    urls = [url] if url else []
    urls += [external_address.through(tunnel, url)] if url and tunnel and tunnel.running else []
    server = Server(_name(layout), tuple(client_command(layout)), url)
    reach = Reach(external_address.networked(layout), tuple(urls), tuple(tokens.kept_values(layout).values()))
    around = _around(environ)
    return tuple(
        client_install.look(known_clients.of(client, server.name), around, server, reach) for client in CLIENTS.values()
    )


def install(
    project: Path, environ: Mapping[str, str], client: str, transport: str | None = None
) -> tuple[Outcome | None, list[Diagnostic]]:
    """Put the endpoint into a client's own file."""
    chosen, layout, found = _chosen(project, environ, client, None)
    if chosen is None or layout is None:
        return None, found
    server, more = _server(layout, chosen, transport)
    if server is None:
        return None, [*found, *more]
    done = client_install.install(chosen, _around(environ), server)
    if isinstance(done, Diagnostic):
        return None, [*found, done]
    return done, [*found, *([_written(done)] if server.url and server.bearer else [])]


def remove(project: Path, environ: Mapping[str, str], client: str) -> tuple[Outcome | None, list[Diagnostic]]:
    """Take the endpoint out of a client's own file, also when it is there no more."""
    chosen, layout, found = _chosen(project, environ, client, None, gone=True)
    if chosen is None or layout is None:
        return None, found
    server = Server(_name(layout), tuple(client_command(layout)), _url(layout))
    done = client_install.remove(chosen, _around(environ), server)
    return (None, [*found, done]) if isinstance(done, Diagnostic) else (done, found)


def notes(outcome: Outcome) -> tuple[str, ...]:
    """The steps by hand after which the client works with the new entry."""
    if outcome.state in ("present", "absent", "removed"):
        return ()
    lines = _token_notes(outcome.client) if outcome.transport == HTTP and outcome.client.reference else []
    return (*lines, outcome.client.after)


def _token_notes(client: Client) -> list[str]:
    show = "octoform token show NAME prints the value"
    if client.prompt is not None:
        return [f"{client.title} asks for the token when it starts the server; {show}"]
    if client.reference is None:
        return [
            f"{client.title} expands no variables: put the token itself in the place of ${{{client.variable}}}; {show}"
        ]
    return [f"set {client.variable} where {client.title} starts; {show}"]


def _written(done: Outcome) -> Diagnostic:
    return warning(
        "CLIENT-TOKEN-WRITTEN",
        f"the value of the token is in {done.file.name}: {done.client.title} cannot refer to a variable",
        path=str(done.file),
        hint="the file has mode 0600 now; keep it out of backups and git, or install with -transport stdio",
    )


def _chosen(
    project: Path, environ: Mapping[str, str], client: str, host: str | None, *, gone: bool = False
) -> tuple[Client | None, Layout | None, list[Diagnostic]]:
    """The client of a name in any of its spellings, and the layout of the host; with ``gone`` also of a former one."""
    name = client.strip().lower().replace(" ", "-").replace("_", "-")
    known = {spelling: item for item in CLIENTS.values() for spelling in (item.key, *item.aliases)}
    chosen = known.get(name)
    if chosen is None:
        near = did_you_mean(name, list(known))
        hint = f"did you mean {known[near].key}?" if near else f"known clients: {', '.join(CLIENTS)}"
        return None, None, [error("CLIENT-UNKNOWN", f"there is no client {client!r}", hint=hint)]
    layout, found = _layout(project, environ, host, gone=gone)
    return (chosen if layout is None else known_clients.of(chosen, _name(layout))), layout, found


def _layout(
    project: Path, environ: Mapping[str, str], host: str | None, *, gone: bool = False
) -> tuple[Layout | None, list[Diagnostic]]:
    if host is not None:
        layout: Layout | None = Layout(project, host)
        found: list[Diagnostic] = []
    elif (remembered := memo.recall(project, environ)) is not None:
        layout, found = Layout(project, remembered.plan.host), []
    else:
        compiled, found = compile_project(project, environ)
        layout = compiled.layout if compiled else None
    if layout is not None and (shut := foreign(layout)):
        return None, [*found, shut]
    if layout is not None and not gone and not layout.committed.exists() and not layout.endpoint.exists():
        hint = "run octoform apply, which builds it"
        return None, [*found, error("ENDPOINT-NOT-APPLIED", f"{layout.host} has no endpoint yet", hint=hint)]
    return layout, found


def _server(layout: Layout, client: Client, transport: str | None) -> tuple[Server | None, list[Diagnostic]]:
    """How the client reaches the endpoint: HTTP where asked for, or where there is one and it can refer to a token."""
    server = Server(_name(layout), tuple(client_command(layout)))
    url = _url(layout)
    if transport == STDIO or (transport is None and (url is None or client.http is None or client.reference is None)):
        return (server, []) if lasting_client_command(layout) else (None, [_temporary()])
    if client.http is None:
        return None, [_no_http(f"{client.title} starts its servers itself and knows no HTTP in its file")]
    if url is None:
        return None, [_no_http("the endpoint has no address of HTTP: it does not run, or its scope is local")]
    bearer = None
    if client.reference is None:
        bearer = _token(layout)
        if bearer is None:
            hint = "make one with octoform token create NAME, or install with -transport stdio"
            summary = f"{client.title} needs the value of a token, and there is none"
            return None, [error("CLIENT-NO-TOKEN", summary, hint=hint)]
    return replace(server, url=url, bearer=bearer), []


def _temporary() -> Diagnostic:
    summary = "octoform runs from a cache, and a client would not find it there later"
    hint = (
        "install it where it stays (uv tool install octoform, pipx install octoform, or a virtual environment), "
        "then run this again with that one"
    )
    return error("CLIENT-COMMAND-TEMPORARY", summary, detail=sys.prefix, hint=hint)


def _no_http(reason: str) -> Diagnostic:
    return error("CLIENT-NO-HTTP", reason, hint="write -transport stdio: on this machine it needs no token")


def _token(layout: Layout) -> str | None:
    """The value of the token that octoform made itself, or of the only one."""
    values = tokens.kept_values(layout)
    return values.get(tokens.DEFAULT) or (next(iter(values.values())) if len(values) == 1 else None)


def _outward(layout: Layout, server: Server) -> tuple[Server, tuple[str, ...]]:
    """The server at its public address where it has one, and what to know of that: what is printed may go anywhere."""
    tunnel = external_address.tunnel_now(layout) if server.url is not None else None
    if server.url is None or tunnel is None:
        return server, ()
    if not tunnel.running:
        reason = f" ({tunnel.reason})" if tunnel.reason else ""
        return server, (f"the tunnel does not run{reason}, so this is the address for this machine and its network",)
    text = "this is the address of the tunnel: it is another one after each start, unless its provider keeps it"
    return replace(server, url=external_address.through(tunnel, server.url)), (text,)


def _url(layout: Layout) -> str | None:
    process = running(layout)
    return process.url if process else None


def _name(layout: Layout) -> str:
    return f"{known_clients.PREFIX}{layout.host}"


def _around(environ: Mapping[str, str]) -> Surroundings:
    return Surroundings(environ, sys.platform)
