"""A project for each test, and one that is applied as a whole for all tests of a file."""

import subprocess
from pathlib import Path

import pytest
from projects import Project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    made = Project(tmp_path / "project", tmp_path / "outside")
    made.write()
    return made


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """A project in a folder with blanks, a quote and umlauts, applied from PROBE to the endpoint."""
    folder = tmp_path_factory.mktemp("live")
    made = Project(folder / "Prüfstand 'zwei' & mehr", folder / "outside")
    made.folder.mkdir()
    made.own_specs()
    made.apply(status=0)
    return made


@pytest.fixture
def repository(project: Project) -> Project:
    """The project as a git repository with one commit."""
    git(project, "init", "--quiet", "--initial-branch=main")
    git(project, "config", "user.name", "A Person")
    git(project, "config", "user.email", "person@example.org")
    project.manifest = {"git": "{commit: true}"}
    project.write()
    git(project, "add", "octopus.yaml")
    git(project, "commit", "--quiet", "-m", "A bench")
    return project


def git(project: Project, *arguments: str) -> str:
    """What git says in the project's folder; it must succeed."""
    done = subprocess.run(["git", *arguments], cwd=project.folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
