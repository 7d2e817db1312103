"""From manifest, specs and profiles to the desired graph; the same on every machine. (Heavy through its inputs.)"""

from collections.abc import Mapping

from octoform import digest
from octoform.graph.model import Graph, Node, NodeKind
from octoform.manifest.model import HarnessSpec, Manifest
from octoform.profiles import Profile
from octoform.protocol import STAGES, Spec

ENDPOINT = "endpoint"


def compile_graph(manifest: Manifest, specs: Mapping[str, Spec], profiles: tuple[Profile, ...]) -> Graph:
    """Five stages in a chain, and the endpoint that octoform itself makes of the last three."""
    nodes = [_stage(name, manifest, specs[name], profiles) for name in STAGES]
    parts = {"setting.scope": str(manifest.scope)}
    nodes.append(Node(ENDPOINT, NodeKind.ENDPOINT, ("interface", "serve", "deploy"), parts))
    return Graph(tuple(nodes))


def _stage(name: str, manifest: Manifest, spec: Spec, profiles: tuple[Profile, ...]) -> Node:
    harness = manifest.harness_for(name)
    model = manifest.model_for(name)
    parts = {"spec": spec.digest, "harness": _maker(harness), "model": model or ""}
    parts |= {f"setting.{key}": _plain(value) for key, value in manifest.settings_for(name).items()}
    if name != "probe":
        parts |= {f"profile.{profile.name}": profile.digest for profile in profiles}
    return Node(
        name=name,
        kind=NodeKind.STAGE,
        consumes=() if name == STAGES[0] else (STAGES[STAGES.index(name) - 1],),
        parts=parts,
        observes_host=name == STAGES[0],
        harness=harness.name,
        model=model,
    )


def _maker(harness: HarnessSpec) -> str:
    """The harness as a key part: its name, and what it runs where the manifest says that."""
    if not harness.command:
        return harness.name
    return f"{harness.name} {digest.short(digest.of_value([*harness.command, harness.prompt_via]))}"


def _plain(value: object) -> str:
    return value if isinstance(value, str) else digest.canonical_json(value).decode()
