"""Compile: manifest, specs and profiles to the desired graph, with every problem of all of them at once. (Heavy.)

Which privileged steps are in force: those that the manifest names, read from their files. (Heavy: YAML.)

Which files a compiled project was read from: manifest, specs, schemas, profiles.
"""

from collections.abc import Collection, Mapping
from pathlib import Path

from octoform import profiles as profile_reader
from octoform.diagnostics import Diagnostic, Span, did_you_mean, error, has_errors
from octoform.engine.plan import memo
from octoform.graph.compile import compile_graph
from octoform.graph.model import Graph
from octoform.manifest.loader import load as load_manifest
from octoform.manifest.loader import named_profiles
from octoform.manifest.model import Manifest, NamedStep, ProfileSource, TypedProfile
from octoform.profiles import Profile
from octoform.protocol import Spec, Step, step_paths
from octoform.protocol.spec_loader import load as load_specs
from octoform.protocol.spec_loader import load_step, schema_dir
from octoform.records import dataclass, field, replace
from octoform.state.layout import Layout


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


MANIFEST = memo.MANIFEST


@dataclass(frozen=True, slots=True)
class Compiled:
    """The desired side of one host.

    ``specs`` are by the names of stages and of the steps' nodes (``step.arm``), ``steps`` by the latter.
    """

    layout: Layout
    manifest: Manifest
    specs: Mapping[str, Spec]
    schemas: Path
    profiles: tuple[Profile, ...]
    graph: Graph
    steps: Mapping[str, Step] = field(default_factory=dict)


def compile_project(
    project: Path, environ: Mapping[str, str], *, named: bool = True
) -> tuple[Compiled | None, list[Diagnostic]]:
    """The compiled project of a folder, or the diagnostics; warnings come along with a result.

    Without ``named`` it is compiled as if no person had described the hardware (the paper's tier 1).
    """
    manifest, found = load_manifest(project / MANIFEST, environ)
    if manifest is not None and not named:
        manifest = replace(manifest, profiles=(), answers={}, privileged_steps=())
    specs, more = load_specs(project / "protocol")
    found = [*found, *more]
    sources = manifest.profiles if manifest else named_profiles(project / MANIFEST)
    profiles, more = profile_reader.load(_source(item) for item in sources)
    found += [_placed(item, sources, project / MANIFEST) for item in more]
    steps, more = select(manifest, profiles, project / "protocol") if manifest else ({}, [])
    found += more
    if manifest is None or has_errors(found):
        return None, found
    graph = compile_graph(manifest, specs, profiles, steps.values())
    layout = Layout(project, manifest.host)
    specs |= {name: step.spec for name, step in steps.items()}
    return Compiled(layout, manifest, specs, schema_dir(project / "protocol"), profiles, graph, steps), found


def _source(item: ProfileSource) -> Path | tuple[str, str]:
    return (item.text, item.place) if isinstance(item, TypedProfile) else item


def _placed(item: Diagnostic, sources: tuple[ProfileSource, ...], manifest: Path) -> Diagnostic:
    """A problem of a profile that is typed into the manifest, at its place there."""
    typed = next((one for one in sources if isinstance(one, TypedProfile) and one.place == item.path), None)
    if typed is None:
        return item
    at = item.span or Span(1, 1)
    end = at.end_column + typed.indent if at.end_column is not None else None
    span = Span(at.line + typed.line - 1, at.column + typed.indent, end)
    source = f"{' ' * typed.indent}{item.source}" if item.source is not None else None
    return replace(item, path=str(manifest), span=span, source=source)


def source_files(compiled: Compiled) -> tuple[Path, ...]:
    """Absolute paths, in a stable order."""
    schemas = sorted(compiled.schemas.glob("*.json"))
    specs = [spec.path for spec in compiled.specs.values()]
    return (compiled.manifest.path, *specs, *schemas, *compiled.manifest.profile_files)
