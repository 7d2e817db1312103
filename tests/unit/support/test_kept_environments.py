"""An environment of all tests that one of them builds again is noticed, once, with what happened."""

import shutil
from pathlib import Path

import pytest
from kept_environments import KeptEnvironments

from octoform.endpoint.environment.model import MARKER


def make(environment: Path) -> None:
    """As a build leaves it."""
    (environment / "bin").mkdir(parents=True)
    (environment / MARKER).write_text("{}")


def test_what_is_built_again_or_dropped_is_noticed_once(tmp_path: Path) -> None:
    kept, one, half = KeptEnvironments(), tmp_path / "0123456789ab", tmp_path / "ba9876543210"
    kept.watch(tmp_path)
    make(one)
    half.mkdir()
    assert kept.changed() == []
    (one / "bytecode").mkdir()
    make(half)  # a build that goes on is no change
    assert kept.changed() == []
    shutil.rmtree(one)
    make(one)
    assert kept.changed() == [f"{one} was built again"]
    assert kept.changed() == []
    shutil.rmtree(half)
    with pytest.raises(pytest.fail.Exception, match=f"{half} was dropped while this test ran, by it or by"):
        kept.check()
