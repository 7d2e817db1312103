"""From manifest, specs and profiles to the desired graph; the same on every machine. Light.

The parts of manifest and profiles that make the endpoint are in the manifest's words. A setting has its part only where
it differs from its default, so the key of an endpoint without such settings is what it was before they were there.
Rules and limits are named by their place, as the endpoint names them when it refuses.
"""

import shlex
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from octoform.base import digest
from octoform.graph.model import ANSWER, Agent, Graph, Node, NodeKind
from octoform.manifest.model import MODEL_FREE, HarnessSpec, Manifest, Network, Tunnel
from octoform.policy.kinds import one_line
from octoform.policy.resolve import Policy
from octoform.protocol import STAGES, Spec, Step
from octoform.protocol.model import FRAME

if TYPE_CHECKING:  # the package brings the YAML reader with it
    from octoform.profiles.model import Profile

ENDPOINT = "endpoint"
RETURNS: Mapping[str, str] = {"interface": "identify", "serve": "interface", "deploy": "serve"}
"""The stages that may find an earlier one at fault, each with the one that is then made again. No key has it: it
decides in which order a run works, never what an output depends on."""
STEP_INPUTS = ("identify", "interface", "serve", "deploy")
_PREFIX = "setting."
SCOPE = f"{_PREFIX}scope"


def compile_graph(
    manifest: Manifest, specs: Mapping[str, Spec], profiles: "tuple[Profile, ...]", steps: Iterable[Step] = ()
) -> Graph:
    """Five stages in a chain, the endpoint that octoform itself makes of them, and the privileged steps behind it.

    Of PROBE the endpoint takes for which devices a profile holds, of IDENTIFY the devices' names, of the others the
    server.
    """
    nodes = [_stage(name, manifest, specs[name], profiles) for name in STAGES]
    parts = endpoint_parts(manifest, profiles)
    if any(profile.limits or profile.stop for profile in profiles):
        parts |= answers(manifest)  # they can decide for which devices such a profile holds
    nodes.append(Node(ENDPOINT, NodeKind.ENDPOINT, tuple(STAGES), parts))
    nodes += [_step(step, manifest, profiles) for step in steps]
    return Graph(tuple(nodes))


def _step(step: Step, manifest: Manifest, profiles: "tuple[Profile, ...]") -> Node:
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


def _stage(name: str, manifest: Manifest, spec: Spec, profiles: "tuple[Profile, ...]") -> Node:
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
        returns=RETURNS.get(name),
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


def endpoint_parts(manifest: Manifest, profiles: "tuple[Profile, ...]") -> dict[str, str]:
    """The key parts of the endpoint of a manifest."""
    out = {SCOPE: manifest.scope}
    for name, text in _settings(manifest.network, manifest.tunnel, manifest.policy).items():
        if text != DEFAULTS.get(name):
            out[name] = text
    return out | dict(_of_profiles(profiles))


def in_force(part: str, scope: str | None) -> str | None:
    """The default of a missing part; None for what the scope, where it is known, does not have."""
    scopes = next((used for prefix, used in _USED_IN.items() if part.startswith(prefix)), None)
    return None if scopes is not None and scope is not None and scope not in scopes else DEFAULTS.get(part)


def _settings(network: Network | None, tunnel: Tunnel | None, policy: Policy) -> dict[str, str]:
    found = dict(_policy(policy))
    if network is not None:
        found |= {"network.interface": network.interface, "network.port": str(network.port)}
        found |= {"network.hosts": ", ".join(network.hosts), "network.origins": ", ".join(network.origins)}
    if tunnel is not None:
        found["tunnel.command"] = shlex.join(tunnel.command)
    return {f"{_PREFIX}{name}": text for name, text in found.items()}


def _policy(policy: Policy) -> Iterator[tuple[str, str]]:
    for name in ("mode", "read", "actuate", "irreversible"):
        yield f"policy.{name}", getattr(policy, name)
    yield "policy.timeout", f"{policy.timeout}s"
    yield "policy.result_bytes", str(policy.result_bytes)
    for index, rule in enumerate(policy.rules):
        yield f"policy.rules[{index}]", f"{rule.decision} {', '.join(rule.tools)}"
    for index, limit in enumerate(policy.limits):
        yield f"policy.limits[{index}]", one_line(limit)
    for glob, seconds in policy.timeouts:
        yield f"policy.timeouts {glob}", f"{seconds}s"


def _of_profiles(profiles: "tuple[Profile, ...]") -> Iterator[tuple[str, str]]:
    """The part of each profile that the endpoint enforces, and the rule that states for which devices."""
    for profile in profiles:
        if profile.limits or profile.stop:
            stop = [[action.kind, action.baud, action.write.hex()] for action in profile.stop]
            limits = [dict(item) for item in profile.limits]
            value = {"evidence": asdict(profile.evidence), "limits": limits, "stop": stop}
            yield f"profile.{profile.name} limits", digest.of_value(value)


DEFAULTS: Mapping[str, str] = _settings(Network(), Tunnel(), Policy())
"""The text of every part that is omitted where it is just this."""
_USED_IN = {f"{_PREFIX}network": ("intranet", "internet"), f"{_PREFIX}tunnel": ("internet",)}
