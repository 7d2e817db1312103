"""What the endpoint says of itself when a client connects: whose hardware it is, and how to deal with it.

The generated server has a name of its own choice; two hosts of one client would look alike by it.
"""

from typing import Any

from .descriptor import Descriptor
from .resources import DEVICES, FRAMES

TEXT = (
    "The hardware of host {host}, as its operating system shows it. Every tool says in its annotations, and in _meta "
    "as octoform/effect, whether it reads, actuates or cannot be undone. The resource {devices} lists the devices and "
    "whether they are there now; {frames}TOOL is the latest picture of a tool. A refused call says which rule or limit "
    "stands against it and what would pass: follow it, and do not try the same call again."
)


def introduce(server: Any, descriptor: Descriptor) -> None:
    """Give a FastMCP server the host's name, octoform's version and instructions for its clients."""
    server._mcp_server.name = f"octoform-{descriptor.host}"
    server._mcp_server.version = descriptor.version
    server.instructions = TEXT.format(host=descriptor.host, devices=DEVICES, frames=FRAMES)
