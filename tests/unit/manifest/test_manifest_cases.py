"""Every golden manifest: its problems with their places, the text a person reads, and what must never be in it."""

import json
import time
from pathlib import Path

import pytest
from cases import for_each
from manifest_cases import Case, all_cases, render_all

from octoform.diagnostics import has_errors, to_json
from octoform.manifest.loader import load

CASES = all_cases()
# The made-up credentials of the cases; each has this word in it.
SECRET = "EXAMPLE"


@for_each("case", CASES)
def test_case(case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, update: bool) -> None:
    case.project_in(tmp_path)
    monkeypatch.chdir(tmp_path)
    started = time.process_time()
    manifest, found = load(Path("octopus.yaml"), case.environ)
    seconds = time.process_time() - started

    expected = {
        "loads": manifest is not None,
        "diagnostics": [
            {"severity": item.severity.value, "code": item.code}
            | ({"at": f"{item.span.line}:{item.span.column}"} if item.span else {})
            for item in found
        ],
    }
    text = render_all(found, colour=False)
    rendered = text + "\n" if text else ""
    if update:
        case.write(expected, rendered)
    assert expected == case.expected
    assert rendered == case.rendered
    assert has_errors(found) == (manifest is None)
    assert seconds < 2.0, "a manifest, however bad, is settled at once"
    for shown in (rendered, json.dumps([to_json(item) for item in found]), repr(manifest)):
        assert SECRET not in shown


def test_there_are_enough_bad_manifests() -> None:
    assert sum(case.is_bad for case in CASES) >= 140


def test_every_bad_manifest_says_what_to_do() -> None:
    silent = [case.name for case in CASES if case.is_bad and "help:" not in case.rendered]
    assert silent == []
