"""The stage: server.py in, the exact direct requirements and the provider of every import out.

A dependency that cannot be had and that only functions import is reported as failed, and the rest goes on: its tool
fails alone when it is called. One that the top of the file needs makes the whole stage an error.
"""

from collections.abc import Mapping
from typing import Any

from octoform.base.files import head
from octoform.builtin.deploy.providers import conflicts, provider
from octoform.builtin.deploy.resolver import Resolution, Resolver
from octoform.builtin.deploy.script import Script, read_script
from octoform.builtin.grammars import Profiles
from octoform.builtin.task import Refused, Task

MAX_BYTES = 1_000_000


def run(task: Task) -> str:
    """Write the DEPLOY artifact; the summary line (``4 requirements, 71 packages``)."""
    if task.input is None:
        raise Refused("stage deploy needs server.py and the task names none")
    try:
        text = head(task.input, MAX_BYTES, follow=True).decode("utf-8")
    except OSError as problem:
        raise Refused(f"cannot read {task.input}: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        raise Refused(f"{task.input.name} is not UTF-8") from problem
    artifact, packages = decide(read_script(text), Resolver(), task.profiles)
    task.write(artifact)
    if artifact["status"] == "error":
        return f"no working set: {artifact['error']}"
    direct = len(artifact["requirements"])
    return f"{direct} requirement{'s' * (direct != 1)}, {packages} packages"


def decide(script: Script, resolver: Resolver, profiles: Profiles = ()) -> tuple[dict[str, Any], int]:
    """The artifact, and how many packages the whole closure has."""
    providers = {module: provider(module, script.requirements, profiles) for module in script.modules}
    unknown = [module for module, name in providers.items() if name is None]
    if unknown:
        reason = f"nothing that the header declares is known to provide {', '.join(unknown)}"
        return _artifact(script, providers, error=reason), 0
    found, failed = _resolve(script, providers, resolver)
    if found.reason is not None:
        return _artifact(script, providers, error=found.reason), 0
    lines, broken = conflicts(script.requirements, found.versions)
    error = lines[0] if broken else None
    return _artifact(script, providers, found.versions, failed, lines, error), len(found.versions)


def _resolve(
    script: Script, providers: Mapping[str, str | None], resolver: Resolver
) -> tuple[Resolution, dict[str, str]]:
    """Versions for as much as can be had, and name to reason of what cannot."""
    found = resolver.resolve(list(script.requirements.values()))
    if found.reason is None:
        return found, {}
    needed = {providers[module] for module, inside in script.modules.items() if not inside}
    spare = {providers[module] for module, inside in script.modules.items() if inside} - needed
    kept = {name: item for name, item in script.requirements.items() if name not in spare}
    if len(kept) == len(script.requirements):
        return found, {}
    best, failed = resolver.resolve(list(kept.values())), {}
    for name in sorted(script.requirements.keys() - kept.keys()):
        if best.reason is not None:
            break
        tried = resolver.resolve([*kept.values(), script.requirements[name]])
        if tried.reason is None:
            best, kept = tried, {**kept, name: script.requirements[name]}
        else:
            failed[name] = tried.reason
    return best, failed


def _artifact(
    script: Script,
    providers: Mapping[str, str | None],
    versions: Mapping[str, str] | None = None,
    failed: Mapping[str, str] | None = None,
    lines: list[str] | None = None,
    error: str | None = None,
) -> dict[str, Any]:
    imports = [{"module": name, "provided_by": "python"} for name in script.standard]
    imports += [{"module": name, "provided_by": name_of} for name, name_of in providers.items() if name_of is not None]
    imports += [{"module": "runtime", "provided_by": "runtime"}] if script.uses_runtime else []
    found = versions or {}
    artifact: dict[str, Any] = {
        "format": 1,
        "status": "ok" if error is None else "error",
        "requirements": [
            {"name": name, "version": found[name], "why": _why(name, providers)}
            for name in sorted(script.requirements)
            if name in found
        ],
        "imports": imports,
    }
    if script.python:
        artifact["python"] = script.python
    if error is not None:
        artifact["error"] = error[:2000]
    if failed:
        artifact["deps_failed"] = [{"name": name, "reason": reason[:500]} for name, reason in sorted(failed.items())]
    if lines:
        artifact["conflicts"] = [line[:500] for line in lines]
    return artifact


def _why(name: str, providers: Mapping[str, str | None]) -> str:
    modules = [module for module, found in providers.items() if found == name]
    return f"provides {', '.join(modules)}" if modules else "declared by the server's header"
