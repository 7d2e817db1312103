"""What tests of every package may use: the option to rewrite golden files, and the invented hosts as trees on disk."""

import fcntl
import gc
import os
import resource
import signal
import subprocess
from collections.abc import Callable, Generator, Iterator
from functools import cache
from importlib.metadata import distributions
from pathlib import Path

import lasting_fork_server
import pytest
import shared_fork_servers
from endings import end_endpoints, may_have_endpoints
from hosts.plant import plant
from hypothesis import HealthCheck, settings
from kept_environments import KeptEnvironments
from projects import Project
from session_folders import remove_session_folders

from octoform.base.files import remove_tree, replace
from octoform.endpoint import bounded_program
from octoform.endpoint.environment.build import GUESS, build, has_environment, prepare
from octoform.endpoint.environment.lockfile import resolve
from octoform.endpoint.environment.model import at, locate
from octoform.state.layout import Layout

KEPT = KeptEnvironments()


def pytest_addoption(parser: pytest.Parser) -> None:
    """``--update`` rewrites the expected files of golden cases instead of comparing with them."""
    parser.addoption("--update", action="store_true", help="rewrite the expected files of golden cases")


def pytest_configure(config: pytest.Config) -> None:
    """A machine that only checks must not write what it should compare with."""
    if config.getoption("--update") and os.environ.get("CI"):
        raise pytest.UsageError("--update is for people: it is refused where CI is set")
    # A shell starts background jobs with interrupts ignored, nohup does so with hang-ups, and programs on a test's
    # terminal would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    bounded_program.SCRIPT = lasting_fork_server.SCRIPT
    shared_fork_servers.share()
    # How long an example takes depends on the machine's other work, not on the code. One change has the same verdict
    # wherever it is tested; examples that nobody has seen are for `make faults`, which asks for the other profile.
    lenient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture])
    settings.register_profile("tests", lenient, max_examples=10, derandomize=True, database=None)
    settings.register_profile("random", lenient, max_examples=500)
    settings.load_profile("tests")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Thousands of tests and their modules stay to the end: looking through them for garbage finds none."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 10)  # a look at every 700 objects takes a sixth of what judging servers does
        gc.enable()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """What is dear comes first: workers take tests from each other's ends, and would make its fixtures once more."""
    items.sort(key=lambda item: item.get_closest_marker("dear") is None)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown() -> Generator[None]:
    """A test that builds an environment of all tests again spoils others, and hardly ever itself."""
    yield
    KEPT.check()


def pytest_sessionfinish() -> None:
    """In each worker as well: see `session_folders`."""
    remove_session_folders()


@pytest.fixture
def thousand_descriptors() -> Iterator[None]:
    """This process has so many files open that the next one has a number above 1023."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, 4096)), hard))
    opened = [os.dup(2) for _ in range(1100)]
    try:
        yield
    finally:
        for each in opened:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))


@pytest.fixture
def update(request: pytest.FixtureRequest) -> bool:
    """True when expected files are to be rewritten."""
    return bool(request.config.getoption("--update"))


@pytest.fixture(scope="session", autouse=True)
def constraints(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Every lock that a test makes has the versions that the tests run with: no release on an index changes a test.

    Locks of the same requirements are then the same ones, whatever the package cache learns meanwhile; otherwise an
    apply would drop the environments of others from a folder that projects share.
    """
    path = run_folder(tmp_path_factory) / "constraints.txt"
    pinned = {f"{item.name}=={item.version}" for item in distributions()}
    replace(path, "".join(f"{line}\n" for line in sorted(pinned)).encode(), synced=False)
    os.environ["UV_CONSTRAINT"] = str(path)
    return path


def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the whole run: that above the folders of its workers."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def environments(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for `Project.share_environments` that all tests of the run have: built by the first who needs it.

    For projects of the scripted agent, whose packages are the same everywhere: an apply drops those of others.
    """
    folder = run_folder(tmp_path_factory) / "environments"
    folder.mkdir(mode=0o700, exist_ok=True)
    KEPT.watch(folder)
    return folder


@pytest.fixture(scope="session", autouse=True)
def shared(environments: Path) -> None:
    """Projects of the scripted agent have them without asking."""
    Project.shared_environments = environments


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory, environments: Path) -> Path:
    """A folder of one environment, compiled once for the run: `Project.take_environments`, `take_bytecode`."""
    layout = Layout(run_folder(tmp_path_factory) / "compiled", "bench")
    layout.environments.mkdir(mode=0o700, parents=True, exist_ok=True)
    with (layout.project / "lock").open("wb") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not has_environment(layout):
            locked, found = resolve(GUESS, layout.project)
            assert locked is not None, found
            own = locate(layout, locked).path
            if at(environments / own.name) is not None:  # an apply has built and compiled it meanwhile
                subprocess.run(["cp", "-al", str(environments / own.name), str(own)], check=True)
            else:
                assert prepare(layout, GUESS)
    KEPT.watch(layout.environments)
    return layout.environments


@pytest.fixture(scope="session")
def packaged(tmp_path_factory: pytest.TempPathFactory, compiled: Path) -> Callable[..., Path]:
    """``packaged("pyserial")`` is a folder for `Project.share_environments`: that of servers with these packages.

    It is built once for the whole run, so that a project whose server needs more than that of the scripted agent
    builds nothing and has its endpoint and its checks as forks of a loaded interpreter too. An apply drops what its
    server does not need: all projects of one folder have the same packages.
    """

    @cache
    def folder(*packages: str) -> Path:
        layout = Layout(run_folder(tmp_path_factory) / "packaged" / "-".join(packages), "bench")
        layout.environments.mkdir(mode=0o700, parents=True, exist_ok=True)
        with (layout.project / "lock").open("wb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not has_environment(layout):
                locked, found = resolve([*GUESS, *packages], layout.project)
                assert locked is not None, found
                donors = [layout.environments / path.name for path in compiled.iterdir() if path.is_dir()]
                for donor in donors:  # copies of links, since the bytecode of one that serves nothing is moved
                    subprocess.run(["cp", "-al", str(compiled / donor.name), str(donor)], check=True)
                environment, found = build(layout, locked)
                for donor in donors:
                    remove_tree(donor)
                assert environment is not None, found
        KEPT.watch(layout.environments)
        return layout.environments

    return folder


@pytest.fixture(autouse=True)
def no_endpoint_is_left(request: pytest.FixtureRequest) -> Iterator[None]:
    """What a test's apply left running ends with the test."""
    folder = request.getfixturevalue("tmp_path") if "tmp_path" in request.fixturenames else None
    yield
    if folder is not None and may_have_endpoints(folder):
        end_endpoints(folder)


@pytest.fixture(scope="session", autouse=True)
def no_endpoint_outlives_the_tests(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """And what the fixtures of whole files left running, with the last test."""
    yield
    end_endpoints(tmp_path_factory.getbasetemp())


@pytest.fixture
def planted(tmp_path: Path) -> Callable[..., Path]:
    """``planted("laptop")`` builds that host's tree and returns its root; a second argument changes its text."""
    count = 0

    def build(name: str, replace: dict[str, str] | None = None) -> Path:
        nonlocal count
        count += 1
        return plant(name, tmp_path / f"{name}-{count}", replace)

    return build
