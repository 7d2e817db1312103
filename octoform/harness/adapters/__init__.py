"""One module for each harness, and which of them a name of the manifest means.

A short name maps to a module, imported only when it is chosen, so that a program no one uses costs nothing.
"""

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import cast

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.harness.port import Harness
from octoform.manifest.model import HarnessSpec

_MODULES: Mapping[str, str] = {
    "builtin": "builtin",
    "claude-code": "claude_code",
    "codex": "codex",
    "command": "command",
    "gemini-cli": "gemini_cli",
    "litellm": "litellm",
    "opencode": "opencode",
    "pi": "pi",
    "qwen-code": "qwen_code",
    "replay": "replay",
}
NAMES = tuple(sorted(_MODULES))


def resolve(spec: HarnessSpec, environ: Mapping[str, str], folder: Path | None = None) -> Harness | Diagnostic:
    """The harness that a manifest describes, or what is wrong with its settings; nothing is started.

    ``environ`` gives the values of references; ``folder`` is the project's, for a program with a relative path.
    """
    module = _MODULES.get(spec.name)
    if module is None:
        near = did_you_mean(spec.name, NAMES)
        hint = f"did you mean {near!r}?" if near else f"known harnesses: {', '.join(NAMES)}"
        return error("HARNESS-UNKNOWN", f"there is no harness {spec.name!r}", hint=hint)
    create = import_module(f"{__name__}.{module}").create
    return cast(Harness | Diagnostic, create(spec, environ, folder))
