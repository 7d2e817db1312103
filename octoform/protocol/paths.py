"""Where specs and schemas lie: the project's own where it has them, the shipped ones otherwise.

Light on purpose: which files matter must be known without reading YAML.
"""

from pathlib import Path, PurePosixPath

from octoform.protocol.model import DUTIES, STAGES, STEP

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
    return {name: own[name] if name in own and own[name].exists() else shipped() / f"{name}.md" for name in names}


def schema_dir(folder: Path | None) -> Path:
    """The folder of all schemas: the project's if it has one, else the shipped one."""
    own = folder / SCHEMAS if folder is not None else None
    return own if own is not None and own.is_dir() else shipped() / SCHEMAS


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
