"""From the checked document to the frozen `Manifest`: defaults filled in, stages resolved. (Heavy: the document.)"""

from pathlib import Path
from types import MappingProxyType

from octoform import digest
from octoform.manifest import document
from octoform.manifest.document import CommandHarness, Document
from octoform.manifest.durations import seconds
from octoform.manifest.model import STAGES, Budget, Git, HarnessSpec, Lifecycle, Manifest, StageSettings


def build(source: Document, path: Path, profiles: tuple[Path, ...], variables: tuple[str, ...]) -> Manifest:
    """The manifest of a document without errors."""
    return Manifest(
        path=path,
        digest=digest.of_value(source.model_dump(mode="json")),
        host=source.host,
        scope=source.scope,
        profiles=profiles,
        stages=MappingProxyType({name: _stage(source, getattr(source.stages, name)) for name in STAGES}),
        lifecycle=Lifecycle(source.lifecycle.prevent_destroy, tuple(source.lifecycle.ignore)),
        git=Git(source.git.commit),
        variables=variables,
    )


def _stage(source: Document, own: document.Stage) -> StageSettings:
    harness = _harness(own.harness or source.harness)
    model = own.model or source.model
    return StageSettings(harness, model if harness.name != "builtin" else None, _budget(source.budget, own.budget))


def _harness(chosen: document.Harness) -> HarnessSpec:
    if isinstance(chosen, CommandHarness):
        return HarnessSpec(chosen.name, tuple(chosen.command), tuple(chosen.env), chosen.prompt)
    return HarnessSpec("builtin")


def _budget(general: document.Budget, own: document.StageBudget) -> Budget:
    attempt, stage = timeouts(general, own)
    return Budget(own.attempts or general.attempts, attempt, stage, general.tools)


def timeouts(general: document.Budget, own: document.StageBudget) -> tuple[float, float]:
    """Seconds for one attempt and for a whole stage, the stage's own settings first."""
    attempt = seconds(own.attempt_timeout or general.attempt_timeout)
    stage = seconds(own.stage_timeout or general.stage_timeout)
    return float(attempt or 0), float(stage or 0)
