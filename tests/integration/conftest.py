"""A project for each test, and one that is applied as a whole for all tests of a file."""

from pathlib import Path

import pytest
from projects import Project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.write()
    return made


@pytest.fixture
def live(applied: Project) -> Project:
    """The applied project, whole again when the test before has taken it down."""
    if not applied.nodes():
        applied.apply(status=0)
    return applied


@pytest.fixture(scope="module")
def applied(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project in a folder with blanks, a quote and umlauts, applied from PROBE to the endpoint."""
    folder = tmp_path_factory.mktemp("live")
    made = Project(folder / "Prüfstand 'zwei' & mehr", folder / "outside")
    made.folder.mkdir()
    made.own_specs()
    made.apply(status=0)
    return made
