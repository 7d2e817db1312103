"""What the endpoint shall be, as a value: who reaches it, with which tools, under which policy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True, slots=True)
class Service:
    """The content of the endpoint's descriptor and policy.

    ``tools`` are the INTERFACE artifact's, ``devices`` ``{"id", "name", "category"}`` as IDENTIFY has them. ``policy``
    is the resolved one in the form of policy.json. ``network`` and ``tunnel`` are None where the scope has none.
    """

    tools: Sequence[Mapping[str, Any]]
    policy: Mapping[str, Any]
    devices: Sequence[Mapping[str, Any]] = field(default=())
    scope: str = "local"
    network: Mapping[str, Any] | None = None
    tunnel: Mapping[str, Any] | None = None
