"""A spec as a value."""

from os.path import lexists
from pathlib import Path, PurePosixPath

from octoform.records import dataclass

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


# Where specs and schemas lie: the project's own where it has them, the shipped ones otherwise.
#
# Light on purpose: which files matter must be known without reading YAML. A link that leads nowhere is the project's
# own as well: its author wants no shipped spec.

SCHEMAS = "schemas"
PRIVILEGED = "privileged"
NOT_STEPS = ("README.md",)


def shipped() -> Path:
    """The folder of the shipped specs: inside the installed package, or at the top of the source tree."""
    packaged = Path(__file__).parent / "shipped"
    return packaged if packaged.is_dir() else Path(__file__).parents[2] / "protocol"


def spec_paths(folder: Path | None) -> dict[str, Path]:
    """The spec file of each stage and duty; a project's ``protocol/`` folder may hold some, all or none of them."""
    names = (*STAGES, *DUTIES)
    own = {} if folder is None else {name: folder / f"{name}.md" for name in names}
    return {name: own[name] if name in own and lexists(own[name]) else shipped() / f"{name}.md" for name in names}


def schema_dir(folder: Path | None) -> Path:
    """The folder of all schemas: the project's if it has one, else the shipped one."""
    own = folder / SCHEMAS if folder is not None else None
    return own if own is not None and lexists(own) else shipped() / SCHEMAS


def step_paths(folder: Path | None) -> dict[str, Path]:
    """The file of each privileged step that there is, by name, sorted: the shipped ones and a project's own.

    A project's own ``protocol/privileged/NAME.md`` takes the place of a shipped one of that name.
    """
    folders = [shipped() / PRIVILEGED, *([folder / PRIVILEGED] if folder is not None else [])]
    found = {path.stem: path for place in folders for path in place.glob("*.md") if path.name not in NOT_STEPS}
    return dict(sorted(found.items()))


def own_path(stage: str) -> PurePosixPath:
    """Where a project's own spec of a stage or of a step (``step.arm``) lies, below its ``protocol/``."""
    if stage.startswith(STEP):
        return PurePosixPath(PRIVILEGED, f"{stage.removeprefix(STEP)}.md")
    return PurePosixPath(f"{stage}.md")


# A privileged step as a value: a spec of its own, and the proof that octoform itself carries out for it.

READING = "reading"
VIEW = "view"
FRAME = "frame"
PROOFS = (READING, VIEW, FRAME)


@dataclass(frozen=True, slots=True)
class Proof:
    """The criterion of a passed hardware test.

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
    for which the profile of the name ``profile`` holds and that IDENTIFY identified with it; None needs no profile.
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
