"""The start of an endpoint for the suites: the launcher as it is, but the server's resources and prompts are served.

A generated server offers tools alone, and the launcher leaves everything else of it out. The suites judge the protocol
by resources and prompts that they name, so for them, and for them alone, this lets the fixture server's through.
"""

import json
import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run() -> int:
    """Serve the endpoint in this file's folder."""
    sys.path.insert(0, str(HERE))
    # FastMCP reads its settings as it is loaded.
    os.environ.update(json.loads((HERE / "connection.json").read_bytes())["environment"])
    from fastmcp.server.middleware import Middleware

    from octoform.server import catalog
    from octoform.server.main import main

    catalog.only_tools = lambda server: Middleware()
    status: int = main(HERE)
    return status


if __name__ == "__main__":
    sys.exit(run())
