"""Targets and replacements that contradict each other are refused before anything is looked at."""

from pathlib import Path

import pytest

from octoform.engine.plan.plan import Request, prepare


@pytest.mark.parametrize(
    ("targets", "replace", "codes"),
    [
        (("probe",), ("deploy",), ["PLAN-REPLACE-OUTSIDE"]),
        (("interface",), ("identify",), []),
        (("probe", "serve"), ("serve",), []),
        ((), ("deploy",), []),
        (("prob",), ("deploy",), ["PLAN-UNKNOWN-NODE"]),
    ],
)
def test_a_replacement_that_the_targets_keep_out(
    tmp_path: Path, targets: tuple[str, ...], replace: tuple[str, ...], codes: list[str]
) -> None:
    (tmp_path / "octopus.yaml").write_text("version: 1\nhost: bench\n")
    outlook, found = prepare(Request(tmp_path, {"OCTOFORM_SYSROOT": str(tmp_path)}, targets, replace))
    assert [item.code for item in found] == codes
    assert (outlook is None) == bool(codes)
