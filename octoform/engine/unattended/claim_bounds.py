"""What the project's profiles call clean of what its tools measure, for the ledger of claims."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from octoform.claims.settings import bounds_told
from octoform.engine.plan.configuration import compile_project
from octoform.profiles.definitions.registers import RegisterGrammar


def bounds(project: Path, environ: Mapping[str, str]) -> list[dict[str, Any]]:
    """Plain values, for `octoform.claims.settings.bounds_of`; none for a project that does not compile.

    Fewer bounds refuse fewer claims, and those that are believed still end by their own readings.
    """
    compiled, _ = compile_project(project, environ)
    if compiled is None:
        return []
    grammars = [(profile.name, profile.grammar) for profile in compiled.profiles]
    registers = [(name, one.registers) for name, one in grammars if isinstance(one, RegisterGrammar)]
    return bounds_told(compiled.layout, [(name, one.protect) for name, one in registers if one.protect is not None])
