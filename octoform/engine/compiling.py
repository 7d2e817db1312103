"""Compile: manifest, specs and profiles to the desired graph, with every problem of all of them at once. (Heavy.)"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from octoform import profiles as profile_reader
from octoform.diagnostics import Diagnostic, has_errors
from octoform.engine import memo
from octoform.graph.compile import compile_graph
from octoform.graph.model import Graph
from octoform.manifest.loading import load as load_manifest
from octoform.manifest.loading import named_profiles
from octoform.manifest.model import Manifest
from octoform.profiles import Profile
from octoform.protocol import Spec
from octoform.protocol.loading import load as load_specs
from octoform.protocol.loading import schema_dir
from octoform.state.layout import Layout

MANIFEST = memo.MANIFEST


@dataclass(frozen=True, slots=True)
class Compiled:
    """The desired side of one host."""

    layout: Layout
    manifest: Manifest
    specs: Mapping[str, Spec]
    schemas: Path
    profiles: tuple[Profile, ...]
    graph: Graph


def compile_project(project: Path, environ: Mapping[str, str]) -> tuple[Compiled | None, list[Diagnostic]]:
    """The compiled project of a folder, or the diagnostics; warnings come along with a result."""
    manifest, found = load_manifest(project / MANIFEST, environ)
    specs, more = load_specs(project / "protocol")
    found = [*found, *more]
    profiles, more = profile_reader.load(manifest.profiles if manifest else named_profiles(project / MANIFEST))
    found += more
    if manifest is None or has_errors(found):
        return None, found
    graph = compile_graph(manifest, specs, profiles)
    layout = Layout(project, manifest.host)
    return Compiled(layout, manifest, specs, schema_dir(project / "protocol"), profiles, graph), found
