"""What the agent says of itself: one JSON object a line, bounded, at once.

``type`` is reply (text, usage {input, cached, output}), call (tool, text), result (failed, text), alive (pieces),
trouble (text, status, final) or closed (ok, text). The lines are the log of the attempt too, so a result carries the
end of what the tool said.
"""

import json
from collections.abc import Mapping
from typing import Any, TextIO

from octoform.harness.asking.client import Refusal

SHOWN = 2000


class Reporter:
    """Writes the lines."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def reply(self, text: str, usage: Mapping[str, int]) -> None:
        """The model has replied."""
        self._tell("reply", text=text[:SHOWN], usage=dict(usage))

    def call(self, tool: str, text: str) -> None:
        """A tool is used; ``text`` says for what."""
        self._tell("call", tool=tool[:SHOWN], text=text[:SHOWN])

    def result(self, text: str, failed: bool) -> None:
        """A tool has ended."""
        self._tell("result", failed=failed, text=text[-SHOWN:])

    def alive(self, pieces: int) -> None:
        """A long reply is still coming in."""
        self._tell("alive", pieces=pieces)

    def trouble(self, refusal: Refusal, final: bool) -> None:
        """A request failed."""
        self._tell("trouble", text=refusal.text[:SHOWN], status=refusal.status, final=final)

    def closed(self, ok: bool, text: str = "") -> None:
        """The run is over."""
        self._tell("closed", ok=ok, text=text[:SHOWN])

    def _tell(self, kind: str, **fields: Any) -> None:
        # Plain ASCII: whatever a model or a tool says, a line stays a line.
        self._stream.write(json.dumps({"type": kind, **fields}) + "\n")
        self._stream.flush()
