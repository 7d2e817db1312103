"""A key that is none is reported before anything is started, in octoform's own words."""

from dataclasses import replace
from pathlib import Path

import pytest
from unit.harness.program_streams import a_task

from octoform.harness.adapters import litellm, pi
from octoform.harness.port import ExitReason, Harness
from octoform.manifest.model import HarnessSpec

SPEC = HarnessSpec("pi", command=("true",), key="LOOP_KEY", base_url="http://127.0.0.1:9")


@pytest.mark.parametrize(("value", "words"), [("", "is empty"), ("loop-1\n", "line break")])
@pytest.mark.parametrize("harness", [pi.create(SPEC, {}, None), litellm.create(SPEC, {}, None)])
def test_nothing_is_started_with_a_key_that_is_none(tmp_path: Path, harness: Harness, value: str, words: str) -> None:
    task = a_task(tmp_path)
    outcome = harness.run(replace(task, environment={**task.environment, "LOOP_KEY": value}), lambda *_: None)
    assert (outcome.reason, outcome.exit_status) == (ExitReason.NOT_INSTALLED, None)
    assert outcome.detail.startswith("the variable LOOP_KEY ") and words in outcome.detail
    assert "loop-1" not in outcome.detail
    assert not (tmp_path / "home").exists()
