"""A spec as a value."""

from dataclasses import dataclass
from pathlib import Path

STAGES = ("probe", "identify", "interface", "serve", "deploy")
DUTIES = ("watch", "heal")
"""What is asked of agents once a deployment runs. Specs like the others, and no nodes of the graph: no key and no plan
rests on them, so one that changes makes nothing again."""
STEP = "step."
"""How the name of a privileged step's node begins; the step's own name follows."""


@dataclass(frozen=True, slots=True)
class Spec:
    """The spec of one stage, of one duty, or of one privileged step: ``stage`` is then the name of the step's node.

    ``text`` is the whole file, ``body`` the prose after the front matter, ``digest`` that of the file's bytes.
    ``consumes`` and ``produces`` are file names as the front matter gives them; ``schema`` is the contract's schema
    file, absent for SERVE; ``budget`` is the front matter's advice in the words of the manifest.
    """

    stage: str
    path: Path
    text: str
    body: str
    digest: str
    consumes: tuple[str, ...]
    produces: str
    schema: Path | None
    budget: str | None = None
