"""Start of the process that owns a host's devices; its command line is what it is known by."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run() -> int:
    """Serve the endpoint in this file's folder."""
    sys.path.insert(0, str(HERE))
    from octoform.server.main import main

    status: int = main(HERE)
    return status


if __name__ == "__main__":
    sys.exit(run())
