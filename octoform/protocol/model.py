"""A spec as a value."""

from dataclasses import dataclass
from pathlib import Path

STAGES = ("probe", "identify", "interface", "serve", "deploy")


@dataclass(frozen=True, slots=True)
class Spec:
    """One stage's spec.

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
