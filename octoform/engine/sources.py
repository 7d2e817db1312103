"""Which files a compiled project was read from: manifest, specs, schemas, profiles."""

from pathlib import Path

from octoform.engine.compiling import Compiled


def source_files(compiled: Compiled) -> tuple[Path, ...]:
    """Absolute paths, in a stable order."""
    schemas = sorted(compiled.schemas.glob("*.json"))
    specs = [spec.path for spec in compiled.specs.values()]
    return (compiled.manifest.path, *specs, *schemas, *compiled.manifest.profile_files)
