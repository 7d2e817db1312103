"""One serving environment for all tests of the endpoint, and tiny packages for the tests that install."""

from pathlib import Path

import pytest
from unit.endpoint.endpoint_servers import Wheelhouse
from warm import Loaded

from octoform.endpoint.environment.build import build
from octoform.endpoint.environment.lockfile import resolve
from octoform.endpoint.environment.model import Environment
from octoform.endpoint.process import start_stop
from octoform.state.layout import Layout


@pytest.fixture(scope="session")
def serving(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Environment:
    """A real environment with FastMCP, built once by the code under test; no test changes it."""
    layout = Layout(tmp_path_factory.mktemp("serving"), "bench")
    layout.local.mkdir(parents=True)
    layout.environments.symlink_to(environments)  # the scripted agent's packages are the same
    lock, problems = resolve(["fastmcp>=4.1,<4.2"], layout.project)
    assert lock, problems
    environment, problems = build(layout, lock)
    assert environment, problems
    return environment


@pytest.fixture
def layout(tmp_path: Path) -> Layout:
    """A host's paths in a project folder of its own, with a blank and a quote in its name."""
    project = tmp_path / "the owner's bench"
    project.mkdir()
    return Layout(project, "bench")


@pytest.fixture
def wheelhouse(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Wheelhouse:
    """A folder of tiny packages as the only index, and a package cache of its own."""
    house = Wheelhouse(tmp_path / "wheels")
    monkeypatch.setenv("UV_NO_INDEX", "1")
    monkeypatch.setenv("UV_FIND_LINKS", str(house.folder))
    monkeypatch.setenv("UV_CACHE_DIR", str(tmp_path / "cache"))
    return house


@pytest.fixture
def forks(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the product starts here is a fork of a process that has loaded: for tests of what is served, not started."""
    monkeypatch.setattr(start_stop, "_Detached", Loaded)
