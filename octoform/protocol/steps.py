"""A privileged step as a value: a spec of its own, and the proof that octoform itself carries out for it."""

from dataclasses import dataclass

from octoform.protocol.model import Spec

READING = "reading"
VIEW = "view"
FRAME = "frame"
PROOFS = (READING, VIEW, FRAME)


@dataclass(frozen=True, slots=True)
class Proof:
    """What counts as done.

    ``kind`` is ``reading`` (a value of the device before and after a movement), ``view`` (a picture before and after)
    or ``frame`` (the content of pictures alone, nothing moves). ``minimum`` is the least difference, in ``unit``;
    for ``frame`` it is 0 and ``unit`` is empty. ``settle`` is how long a movement may take, in seconds.
    """

    kind: str
    minimum: float
    unit: str
    settle: float


@dataclass(frozen=True, slots=True)
class Step:
    """One privileged step.

    ``name`` is that of the manifest (``arm``); its node, and ``spec.stage``, is ``step.arm``. It runs only for a device
    for which the profile of the name ``profile`` holds and that IDENTIFY annotated with it; None needs no profile.
    """

    name: str
    about: str
    profile: str | None
    proof: Proof
    spec: Spec

    @property
    def node(self) -> str:
        """The name of its node in the graph, in the state and among the specs."""
        return self.spec.stage
