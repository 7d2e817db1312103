"""The configuration of the agent's process: one JSON file, written by the adapter, that holds no secret."""

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from octoform.base.files import read_json, replace
from octoform.harness.llm.route import Route
from octoform.records import dataclass


@dataclass(frozen=True, slots=True)
class Config:
    """Paths are absolute; ``output`` lies in ``workdir``. ``hidden`` are variables that no command gets.

    ``request_seconds`` is how long a request may be silent, ``shell_seconds`` and ``most_shell_seconds`` what a
    command may take when the model reports nothing, and at most.
    """

    route: Route
    prompt: str
    output: str
    workdir: str
    request_seconds: float
    shell_seconds: int
    most_shell_seconds: int
    backoff_seconds: float
    hidden: Sequence[str] = ()
    web_search: bool = False

    def write(self, path: Path) -> None:
        """Write it; OSError when the disk refuses it."""
        replace(path, json.dumps(asdict(self)).encode(), 0o644, synced=False)


def read(path: Path) -> Config:
    """Read what the adapter of this version wrote."""
    value = read_json(path, any_text=True)
    return Config(**{**value, "route": Route(**value["route"])})
