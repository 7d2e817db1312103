"""Which harness a name of the manifest means.

A short name maps to a factory by its dotted path, imported only when it is chosen, so that a program nobody uses
costs nothing.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import cast

from octoform.diagnostics import Diagnostic, did_you_mean, error
from octoform.harness.port import Harness

BUILTIN = "octoform.harness.builtin:BuiltinHarness"
COMMAND = "octoform.harness.command:create"
FACTORIES: Mapping[str, str] = {"builtin": BUILTIN, "command": COMMAND}
NAMES = tuple(sorted(FACTORIES))


def resolve(
    name: str,
    command: Sequence[str] = (),
    env: Sequence[str] = (),
    prompt_via: str = "stdin",
    folder: Path | None = None,
) -> Harness | Diagnostic:
    """The harness of that name with its settings, or what is wrong with them; nothing is started.

    ``command``, ``env`` (names of variables) and ``prompt_via`` concern programs; ``folder`` is the project's, for a
    program that is given by a relative path.
    """
    path = FACTORIES.get(name)
    if path is None:
        near = did_you_mean(name, NAMES)
        hint = f"did you mean {near!r}?" if near else f"known harnesses: {', '.join(NAMES)}"
        return error("HARNESS-UNKNOWN", f"there is no harness {name!r}", hint=hint)
    module, _, attribute = path.partition(":")
    factory = getattr(import_module(module), attribute)
    if path == BUILTIN:
        if command or env:
            return error(
                "HARNESS-BUILTIN-SETTINGS",
                "the embedded agent takes no command and no variables",
                hint="leave them out, or set name: command",
            )
        return cast(Harness, factory())
    return cast(Harness | Diagnostic, factory(command, env, prompt_via, folder))
