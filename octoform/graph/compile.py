"""From manifest, specs and profiles to the desired graph; the same on every machine. (Heavy through its inputs.)"""

from collections.abc import Iterable, Mapping
from pathlib import Path

from octoform.base import digest
from octoform.graph import endpoint_parts
from octoform.graph.model import ANSWER, Agent, Graph, Node, NodeKind
from octoform.manifest.model import MODEL_FREE, HarnessSpec, Manifest
from octoform.profiles import Profile
from octoform.protocol import STAGES, Spec, Step
from octoform.protocol.model import FRAME

ENDPOINT = "endpoint"
STEP_INPUTS = ("identify", "interface", "serve", "deploy")


def compile_graph(
    manifest: Manifest, specs: Mapping[str, Spec], profiles: tuple[Profile, ...], steps: Iterable[Step] = ()
) -> Graph:
    """Five stages in a chain, the endpoint that octoform itself makes of them, and the privileged steps behind it.

    Of PROBE the endpoint takes for which devices a profile holds, of IDENTIFY the devices' names, of the others the
    server.
    """
    nodes = [_stage(name, manifest, specs[name], profiles) for name in STAGES]
    parts = endpoint_parts.parts(manifest, profiles)
    if any(profile.limits or profile.stop for profile in profiles):
        parts |= answers(manifest)  # they can decide for which devices such a profile holds
    nodes.append(Node(ENDPOINT, NodeKind.ENDPOINT, tuple(STAGES), parts))
    nodes += [_step(step, manifest, profiles) for step in steps]
    return Graph(tuple(nodes))


def _step(step: Step, manifest: Manifest, profiles: tuple[Profile, ...]) -> Node:
    """A step is behind the endpoint, through which it is carried out, and depends on what the endpoint is made of.

    A restart of the endpoint proves nothing again; another server does.
    """
    harness = manifest.harness_for(step.node)
    model = manifest.model_for(step.node)
    parts = {"spec": step.spec.digest, "harness": _maker(harness, manifest.project), "model": model or ""}
    parts |= {f"profile.{profile.name}": profile.digest for profile in profiles if profile.name == step.profile}
    if step.proof.kind == FRAME:
        parts |= {f"setting.{key}": value for key, value in manifest.camera_hint().items()}
    return Node(
        name=step.node,
        kind=NodeKind.STEP,
        consumes=STEP_INPUTS,
        parts=parts,
        harness=harness.name,
        model=model,
        calls_model=_calls_model(harness),
        after=(ENDPOINT,),
    )


def _stage(name: str, manifest: Manifest, spec: Spec, profiles: tuple[Profile, ...]) -> Node:
    harness = manifest.harness_for(name)
    model = manifest.model_for(name)
    second = manifest.stages[name].escalate
    parts = {"spec": spec.digest, "harness": _maker(harness, manifest.project), "model": model or ""}
    if second is not None:
        # Only where there is one, so that all other keys are as they were.
        parts |= {"escalate.harness": _maker(second.harness, manifest.project), "escalate.model": second.model or ""}
    parts |= {f"setting.{key}": _plain(value) for key, value in manifest.settings_for(name).items()}
    if name == "identify":
        parts |= answers(manifest)
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
        calls_model=any(_calls_model(one) for one in (harness, second.harness if second is not None else None)),
        escalate=Agent(second.harness.name, second.model) if second is not None else None,
    )


def answers(manifest: Manifest) -> dict[str, str]:
    """A person's answers about devices, for the input hash: the sentences, so that a plan can show them."""
    return {f"{ANSWER}{device}": sentence for device, sentence in manifest.answers.items()}


def _maker(harness: HarnessSpec, project: Path) -> str:
    """The harness as a key part: its name, and what else decides what it makes.

    That is the command line of any program, the recording that is given again (by its path in the project, which is
    the same on every machine) and a search of the web. Where a known program stands, how it reaches its model, what it
    may see and what it may use are no part: they decide whether an output comes, never what it states.
    """
    if harness.name == "command":
        return f"{harness.name} {digest.short(digest.of_value([*harness.command, harness.prompt_via]))}"
    if harness.recording is not None:
        return f"{harness.name} {harness.recording.relative_to(project).as_posix()}"
    return f"{harness.name} web_search" if harness.web_search else harness.name


def _calls_model(harness: HarnessSpec | None) -> bool:
    return harness is not None and harness.name not in MODEL_FREE


def _plain(value: object) -> str:
    return value if isinstance(value, str) else digest.canonical_json(value).decode()
