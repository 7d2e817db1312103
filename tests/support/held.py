"""Runs one stage with an agent whose attempts are wrong one after the other, and tells what each was refused for."""

import copy
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from projects import Project

Output = dict[str, Any]
Change = Callable[[Output], None]
Edit = Callable[[str], str]
MOST_ATTEMPTS = 18
"""The most that are tried in one run here; the manifest takes up to 20."""


def refusals(
    folder: Path,
    host: Path,
    stage: str,
    earlier: Mapping[str, Output],
    good: Output | str,
    changes: Sequence[Change] | Sequence[Edit],
    compiled: Path | None = None,
) -> tuple[Project, list[dict[str, str]]]:
    """The errors of each attempt but the last, which must be accepted: code to the whole diagnostic as text.

    ``earlier`` are the outputs of the stages before; each attempt writes ``good`` after one of the ``changes``, which
    make another text of a text. ``compiled`` is the fixture of that name, for stages that build some.
    """
    project = Project(folder / "project", folder / "outside")
    project.environ["OCTOFORM_SYSROOT"] = str(host)
    if compiled is not None:
        project.take_bytecode(compiled)
    errors: list[list[Output]] = []
    for first in range(0, len(changes), MOST_ATTEMPTS):
        part = changes[first : first + MOST_ATTEMPTS]
        project.script = {name: [{"write": json.dumps(output)}] for name, output in earlier.items()}
        project.script[stage] = [{"write": _written(good, change)} for change in part]
        project.manifest = {"stages": f"{{{stage}: {{budget: {{attempts: {len(part)}}}}}}}"}
        done = project.apply("-target", stage, status=0 if part[-1] is changes[-1] else 1)
        errors += [event["diagnostics"] for event in done.events() if event["type"] == "attempt_errored"]
    assert len(errors) == len(changes) - 1, "an attempt was accepted before its time"
    return project, [{item["code"]: json.dumps(item, ensure_ascii=False) for item in each} for each in errors]


def _written(good: Output | str, change: Any) -> str:
    return str(change(good)) if isinstance(good, str) else json.dumps(changed(good, change))


def changed(good: Output, change: Change) -> Output:
    """A copy after the change; members that it has set to None are gone."""
    value = copy.deepcopy(good)
    change(value)
    return dict(_without_none(value))


def both(*changes: Change) -> Change:
    """One change after the other."""

    def change(value: Output) -> None:
        for each in changes:
            each(value)

    return change


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _without_none(member) for name, member in value.items() if member is not None}
    return [_without_none(each) for each in value] if isinstance(value, list) else value
