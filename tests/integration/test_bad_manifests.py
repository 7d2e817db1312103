"""Bad manifests of the golden cases through the command line: clear errors, exit status 1, nothing else."""

from pathlib import Path

import pytest
from cases import for_each
from manifest_cases import Case, all_cases

from octoform.cli.main import main

# What is wrong with each of them is shown at the loader; here a sample shows what the commands make of it.
BAD = [case for case in all_cases() if case.is_bad][::8]


@for_each("case", BAD)
def test_is_refused_by_plan_and_validate(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    project = case.project_in(tmp_path)
    for name, value in case.environ.items():
        monkeypatch.setenv(name, value)
    before = sorted(tmp_path.rglob("*"))
    for command in ("validate", "plan"):
        assert main(["-chdir", str(project.parent if project.is_file() else project), command]) == 1
        shown = capsys.readouterr()
        assert shown.err.count("error[MANIFEST-") >= 1
        assert "Traceback" not in shown.err + shown.out
    assert sorted(tmp_path.rglob("*")) == before
