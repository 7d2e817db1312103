"""Accepted artifacts as values again, for the rules and the proofs of later stages."""

from pathlib import Path
from typing import Any

from octoform.apply.context import Context
from octoform.base import files
from octoform.contracts.parsing import parse
from octoform.state.layout import STAGES


def accepted(context: Context, stage: str) -> Any:
    """The value of an accepted artifact; ValueError when it is not there, which the order of the run prevents."""
    path = context.layout.output(stage)
    value, found = parse(stage, files.read(path), str(path))
    if value is None:
        raise ValueError(f"{path} cannot be read any more: {found}")
    return value


def predecessor(context: Context, stage: str) -> Path | None:
    """The accepted artifact that the stage may read; None for the first."""
    consumes = context.graph.node(stage).consumes
    return context.layout.output(consumes[0]) if consumes else None


def accepted_before(context: Context, stage: str) -> dict[str, Any]:
    """The values of all accepted artifacts of the stages before ``stage`` (or before a step), by stage."""
    names = context.graph.names()
    before = [name for name in names[: names.index(stage)] if name in STAGES]
    return {name: accepted(context, name) for name in before if context.layout.output(name).is_file()}
