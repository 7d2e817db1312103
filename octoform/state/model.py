"""The content of ``state/<host>/state.json``.

Fields that this octoform does not know are kept and written back as they were, so that two people with different
octoforms can work on one repository; a change that an older one must not touch raises ``format``, which it refuses.
(Heavy: imports pydantic. A no-op plan uses `octoform.state.store.quick_read`.)
"""

import json
from enum import StrEnum
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from octoform.base import digest

FORMAT = 1
RFC3339 = r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d+)?(Z|[+-]\d\d:\d\d)$"


class Status(StrEnum):
    """How a node's last run ended. ``interrupted``: it began and no one saw it end."""

    ACCEPTED = "accepted"
    INTERRUPTED = "interrupted"
    FAILED = "failed"


class Persisted(BaseModel):
    """Base of everything in the state file: immutable, finite numbers only, unknown fields kept.

    pydantic compiles a class with its first value: most commands read a few of these documents, and none reads all.
    """

    model_config = ConfigDict(frozen=True, extra="allow", allow_inf_nan=False, defer_build=True)


class Usage(Persisted):
    """The cost of the accepted run's agents: tokens as counts, US dollars and who priced them; None is unknown."""

    input_tokens: int | None = None
    cached_tokens: int | None = None
    output_tokens: int | None = None
    cost_usd: float | None = None
    cost_source: str | None = None


class NodeState(Persisted):
    """The state of one node.

    ``key``, ``key_parts``, ``output_digest`` (canonical: instances and times omitted) and ``file_digest`` (the
    committed files as they are) belong to the accepted output and are empty when there never was one; they survive
    a later run that failed or was interrupted. ``seconds`` is wall time of the accepted run, all attempts. ``program``
    is the agent's program with its version, ``specs`` the digest of all specs, and ``platform`` what PROBE reports of
    the system: by whom, from which specs and for which platform the output was made.
    """

    key: str = ""
    key_parts: dict[str, str] = Field(default_factory=dict)
    output_digest: str = ""
    file_digest: str = ""
    harness: str | None = None
    model: str | None = None
    program: str | None = Field(default=None, exclude_if=lambda value: value is None)
    specs: str | None = Field(default=None, exclude_if=lambda value: value is None)
    platform: dict[str, str] = Field(default_factory=dict, exclude_if=lambda value: not value)
    attempts: int = 0
    usage: Usage = Field(default_factory=Usage)
    seconds: float = 0.0
    accepted_at: str | None = Field(default=None, pattern=RFC3339)
    tainted: bool = False
    status: Status = Status.ACCEPTED
    detail: dict[str, Any] = Field(default_factory=dict)


class GitRecord(Persisted):
    """The repository's revision when the state was written, and which inputs were not as committed."""

    revision: str | None = None
    dirty: list[str] = Field(default_factory=list)


class Snapshot(Persisted):
    """The state of one host. ``lineage`` names this history of states, ``serial`` counts its versions.

    ``tier1``: the last run was without profiles and answers, as if no person had described the hardware.
    """

    format: Literal[1] = 1
    octoform: str
    host: str
    lineage: str
    serial: int = Field(default=0, ge=0)
    manifest_digest: str | None = None
    git: GitRecord | None = None
    tier1: bool = Field(default=False, exclude_if=lambda value: not value)
    nodes: dict[str, NodeState] = Field(default_factory=dict)


def to_json(value: Persisted) -> dict[str, Any]:
    """The JSON object of a persisted value, unknown fields included."""
    return value.model_dump(mode="json")


def encode(snapshot: Snapshot) -> bytes:
    """The bytes of the state file: sorted and indented, so that git shows what changed."""
    text = json.dumps(to_json(snapshot), indent=2, sort_keys=True, ensure_ascii=False, allow_nan=False)
    return f"{text}\n".encode()


def content_digest(snapshot: Snapshot) -> str:
    """Digest of what a new serial stands for: the nodes and the manifest, not who wrote it or at which revision."""
    document = to_json(snapshot)
    for name in ("serial", "git", "octoform"):
        document.pop(name, None)
    return digest.of_value(document)


def state_digest(snapshot: Snapshot) -> str:
    """Digest of the whole snapshot as JSON; indifferent to line ends and indentation of the file."""
    return digest.of_value(to_json(snapshot))
