"""A project for each test, and one that is applied as a whole for all tests of a file."""

from pathlib import Path

import pytest
from projects import Project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.write()
    return made
