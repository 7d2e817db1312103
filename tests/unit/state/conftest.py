"""A project folder of its own for each test."""

from pathlib import Path

import pytest

from octoform.state.layout import Layout


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    project = tmp_path / "project"
    project.mkdir()
    return Layout(project, "bench")
