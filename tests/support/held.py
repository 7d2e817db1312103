"""What each of many wrong outputs of one stage is refused for, in the run of an agent or by the contract alone.

What the contract refuses is judged here, with all that is dear made once. An agent is run for what only its run shows
(a server that has to be imported), for some of the others, so that both ways are seen to say the same, and for the one
that must be accepted in the end.
"""

import copy
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from case_hosts import SCHEMAS
from projects import Project

from octoform.apply.stage.secret_scan import blanked
from octoform.base.id_databases import IdDatabases
from octoform.builtin.scan import beside
from octoform.contracts.artifact_parser import parse
from octoform.contracts.contract_check import check, has_shape
from octoform.contracts.model import Artifacts, HostScan
from octoform.diagnostics import Diagnostic, Severity, to_json

Output = dict[str, Any]
Change = Callable[[Output], None]
Edit = Callable[[str], str]
Known = Callable[[Any], Artifacts]
"""What the contract holds an output to, for the value of that output."""
ALSO_RUN = 3
MAX_ATTEMPTS = 18
"""The most that are tried in one run here; the manifest takes up to 20."""


def refusals(
    folder: Path,
    host: Path,
    stage: str,
    earlier: Mapping[str, Output],
    good: Output | str,
    changes: Sequence[Change] | Sequence[Edit],
    environments: Path | None = None,
    known: Known | None = None,
) -> tuple[Project, list[dict[str, str]]]:
    """The errors of each output but the last, which must be accepted: code to the whole diagnostic as text.

    ``earlier`` are the outputs of the stages before; each output is ``good`` after one of the ``changes``, which
    make another text of a text. ``environments`` is for `Project.share_environments`. ``known`` is what
    the contract is given with an output; without it an agent is run for every one.
    """
    if known is None:
        return _run(folder, host, stage, earlier, good, changes, environments)
    found = [_by_contract(stage, _written(good, change), known) for change in changes]
    assert not found[-1], found[-1]
    refused = [place for place, errors in enumerate(found) if errors]
    assert len(refused) >= ALSO_RUN
    also = {refused[number * (len(refused) - 1) // (ALSO_RUN - 1)] for number in range(ALSO_RUN)}
    tried = [place for place, errors in enumerate(found[:-1]) if not errors or place in also]
    project, ran = _run(folder, host, stage, earlier, good, [changes[place] for place in [*tried, -1]], environments)
    for place, errors in zip(tried, ran, strict=True):
        assert place not in also or errors.keys() == found[place].keys(), "the run says something else"
        found[place] = errors
    return project, found[:-1]


def scanned(host: Path) -> Known:
    """What PROBE is held to: the host's own scan."""

    def known(value: Any) -> Artifacts:
        if not has_shape("probe", value, SCHEMAS):
            return Artifacts()
        seen = beside(value, host)
        return Artifacts(scan=HostScan(blanked(seen["probe"]), tuple(seen["unsaid"]), tuple(seen["untrue"])))

    return known


def probed(host: Path, probe: Output) -> Known:
    """What IDENTIFY is held to: the accepted PROBE, and the id databases of the host."""
    databases = IdDatabases(host)
    registered = {
        each["id"]: " ".join(databases.lookup(each["interface"], each["vid"], each["pid"])).strip()
        for each in probe["devices"]
        if each.get("vid") and each.get("pid")
    }
    return lambda _: Artifacts(probe=probe, registered=registered)


def _by_contract(stage: str, text: str, known: Known) -> dict[str, str]:
    """The errors of an output by its contract alone, in the same form."""
    value, found = parse(stage, text.encode(), "output.json")
    listed: list[Diagnostic] = found + (check(stage, value, known(value), SCHEMAS) if value is not None else [])
    if not any(item.severity is Severity.ERROR for item in listed):
        return {}
    return {item.code: json.dumps(to_json(item), ensure_ascii=False) for item in listed}


def _run(
    folder: Path,
    host: Path,
    stage: str,
    earlier: Mapping[str, Output],
    good: Output | str,
    changes: Sequence[Any],
    environments: Path | None,
) -> tuple[Project, list[dict[str, str]]]:
    """The same, each from an attempt of its own."""
    project = Project(folder / "project", folder / "outside")
    project.environ["OCTOFORM_SYSROOT"] = str(host)
    if environments is not None:
        project.share_environments(environments)
    errors: list[list[Output]] = []
    for first in range(0, len(changes), MAX_ATTEMPTS):
        part = changes[first : first + MAX_ATTEMPTS]
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
