"""The connection descriptor as octoform wrote it beside this package. Standard library only."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.base import files

FORMAT = 2


class RefusedError(Exception):
    """The endpoint may not be served as it is; the text is one line for a person."""


@dataclass(frozen=True)
class Descriptor:
    """connection.json of the endpoint in ``folder``.

    ``version`` is that of the octoform which wrote it. ``tools`` have name, effect, devices and annotations;
    ``devices`` have id, name and category. ``run`` and ``log`` are the folders of what the process keeps and writes.
    ``network`` is None in scope local, ``tunnel`` in all but internet.
    """

    folder: Path
    host: str
    version: str
    scope: str
    environment: Mapping[str, str]
    tools: tuple[Mapping[str, Any], ...]
    devices: tuple[Mapping[str, Any], ...]
    server: Mapping[str, Any]
    run: Path
    log: Path
    network: Mapping[str, Any] | None
    tunnel: Mapping[str, Any] | None

    @property
    def policy(self) -> Path:
        """The file with the resolved policy."""
        return self.folder / "policy.json"

    @property
    def instances(self) -> Path:
        """The file that states which unit each device id is."""
        return Path(self.environment["OCTOFORM_INSTANCES"])


def read(folder: Path) -> Descriptor:
    """The descriptor of an endpoint's folder; RefusedError when it cannot be read or is another format's."""
    try:
        value = files.record(files.read_json(folder / "connection.json"), FORMAT)
        return Descriptor(
            folder=folder,
            host=value["host"],
            version=value["octoform"],
            scope=value["scope"],
            environment=value["environment"],
            tools=tuple(value["tools"]),
            devices=tuple(value["devices"]),
            server=value["server"],
            run=Path(value["paths"]["run"]),
            log=Path(value["paths"]["log"]),
            network=value["network"],
            tunnel=value["tunnel"],
        )
    except (OSError, ValueError, LookupError, TypeError) as problem:
        raise RefusedError(f"the connection descriptor cannot be read ({problem}); run octoform apply") from problem


def untouched(folder: Path) -> None:
    """RefusedError when a file that decides what is let through is not the one that octoform published.

    The manifest of the endpoint has their digests. The clients' configurations decide nothing and may be edited.
    """
    try:
        listed = files.read_json(folder / "manifest.json")["files"]
        wanted = {name: digest for name, digest in listed.items() if not name.startswith("clients/")}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as problem:
        raise RefusedError(f"the endpoint's manifest cannot be read ({problem}); run octoform apply") from problem
    for name, digest in sorted(wanted.items()):
        path = folder / name
        if digest_of_file(path) != digest:
            raise RefusedError(f"{path} is not the file that was published; run octoform apply")


def digest_of_file(path: Path) -> str | None:
    """The digest of a file's bytes; None where there is no file that can be read."""
    try:
        return digest_of(files.read(path))
    except OSError:
        return None


def digest_of(data: bytes) -> str:
    """The digest of a file's bytes, as octoform writes it."""
    return "sha256:" + hashlib.sha256(data).hexdigest()
