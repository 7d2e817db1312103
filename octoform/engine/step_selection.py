"""Which privileged steps are in force: those that the manifest names, read from their files. (Heavy: YAML.)"""

from collections.abc import Collection
from pathlib import Path

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.manifest.model import Manifest, NamedStep
from octoform.profiles import Profile
from octoform.protocol import Step, step_paths
from octoform.protocol.step_loading import load_step


def select(
    manifest: Manifest, profiles: Collection[Profile], protocol: Path
) -> tuple[dict[str, Step], list[Diagnostic]]:
    """The steps by the names of their nodes, in the manifest's order, and what is wrong with them.

    ``protocol`` is the project's folder of specs; it need not exist.
    """
    steps: dict[str, Step] = {}
    found: list[Diagnostic] = []
    paths = step_paths(protocol) if manifest.privileged_steps else {}
    for named in manifest.privileged_steps:
        if named.name not in paths:
            found.append(_unknown(manifest, named, tuple(paths)))
            continue
        step, problems = load_step(named.name, paths[named.name], protocol)
        found += problems
        if step is None:
            continue
        if step.profile is not None and step.profile not in {profile.name for profile in profiles}:
            found.append(_without_profile(manifest, named, step.profile))
        steps[step.node] = step
    return steps, found


def _unknown(manifest: Manifest, named: NamedStep, known: tuple[str, ...]) -> Diagnostic:
    near = did_you_mean(named.name, known)
    listed = f"known: {', '.join(known)}; protocol/privileged/{named.name}.md would add it"
    hint = f"did you mean `{near}`?" if near else listed
    return _at(manifest, named, "STEP-UNKNOWN", f"there is no privileged step `{named.name}`", hint)


def _without_profile(manifest: Manifest, named: NamedStep, profile: str) -> Diagnostic:
    summary = f"the step `{named.name}` needs the profile {profile}, and `profiles` does not name it"
    hint = f"add it to `profiles`, such as profiles/{profile}.md, or take the step out"
    return _at(manifest, named, "STEP-WITHOUT-PROFILE", summary, hint)


def _at(manifest: Manifest, named: NamedStep, code: str, summary: str, hint: str) -> Diagnostic:
    return error(code, summary, path=str(manifest.path), span=named.span, source=named.source, hint=hint)
