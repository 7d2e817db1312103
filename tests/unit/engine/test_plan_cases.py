"""The text of a plan, to a person and to a program, for one situation after another; see `plan_cases`."""

from pathlib import Path

import pytest
from plan_cases import Case, all_cases, comparable

from octoform.cli.main import main

CASES = all_cases()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_says_what_will_run_and_why(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], update: bool
) -> None:
    project, root = case.lay_out(tmp_path)
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(root))
    command = ["-chdir", str(project), "plan", "-detailed-exitcode", *case.facts.get("arguments", [])]
    capsys.readouterr()
    status = main(command)
    text = capsys.readouterr()
    assert main([*command, "-json"]) == status
    document = {"exit": status, "events": comparable(capsys.readouterr().out)}
    if update:
        case.write(text.out, text.err, document)
    assert (text.out, text.err) == (case.text, case.warnings)
    assert document == case.document


def test_there_is_a_case_for_every_reason_to_run() -> None:
    reasons = [
        reason["cause"]
        for case in CASES
        for event in case.document["events"]
        if event["type"] == "planned_change"
        for reason in event["change"]["reasons"]
    ]
    missing = {
        "new",
        "interrupted",
        "failed",
        "tainted",
        "requested",
        "changed",
        "artifact-deleted",
        "artifact-edited",
        "artifact-link",
        "endpoint",
        "instances-gone",
        "upstream",
        "removed",
    }
    assert missing - set(reasons) == set()
