"""One ready-made configuration for each MCP client, in the client's own format.

Absolute paths and no environment: a client can start the command from anywhere. The forms are those that `octoform
clients install` puts into a client's own file, see `clients.formats`.
"""

from collections.abc import Sequence

from octoform.endpoint.mcp_clients.formats import CLIENTS, Client, form, of
from octoform.endpoint.mcp_clients.merge import Wish, written


def snippets(name: str, command: Sequence[str], url: str | None = None) -> dict[str, str]:
    """File name to text for each client; ``name`` is what the client calls the server, ``command`` what it starts.

    With a ``url``, clients that know HTTP get that; the token is referred to.
    """
    return {client.file: snippet(client, name, command, url) for client in CLIENTS.values()}


def snippet(client: Client, name: str, command: Sequence[str], url: str | None = None) -> str:
    """The text of one client's configuration that holds this server and nothing else."""
    client = of(client, name)
    entry = form(client, name, command, url) or form(client, name, command, None)
    assert entry is not None
    with_prompt = url is not None and client.http is not None
    return written(client, Wish(client.table, name, entry, prompted=with_prompt))
