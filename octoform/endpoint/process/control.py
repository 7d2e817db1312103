"""Ask the running endpoint's control thread: one line of JSON each way. Light."""

import json
from collections.abc import Mapping
from typing import Any

from octoform.base.files import parse
from octoform.endpoint.sockets import connect
from octoform.state.layout import Layout

SOCKET = "control.sock"
MOST_BYTES = 16_000_000


def ask(layout: Layout, question: Mapping[str, Any], seconds: float = 5.0) -> dict[str, Any] | None:
    """The answer to ``{"op": ..., ...}``; None when no process answers within ``seconds``."""
    try:
        with connect(layout.run / SOCKET, seconds) as connection:
            connection.sendall(json.dumps(question).encode() + b"\n")
            data = b""
            while not data.endswith(b"\n") and len(data) < MOST_BYTES:
                part = connection.recv(65536)
                if not part:
                    break
                data += part
            answer = parse(data)
    except (OSError, ValueError):
        return None
    return answer if isinstance(answer, dict) else None
