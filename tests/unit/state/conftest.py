"""A project folder of its own for each test."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

from octoform.state.layout import Layout

MEMORY = Path("/dev/shm")


@pytest.fixture
def layout(quick_path: Path) -> Layout:
    """The paths of a host of an empty project."""
    project = quick_path / "project"
    project.mkdir()
    return Layout(project, "bench")


@pytest.fixture
def quick_path() -> Iterator[Path]:
    """A folder in memory where there is one: hundreds of applies would wait for the disk's syncs otherwise."""
    place = MEMORY if os.access(MEMORY, os.W_OK) else None
    folder = Path(tempfile.mkdtemp(prefix="octoform-", dir=place))
    yield folder
    shutil.rmtree(folder)
