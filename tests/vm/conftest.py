"""A booted guest for each architecture and each file of tests, onboarded once; what was seen is printed at the end.

Nothing of this is collected unless `pytest -m vm` asks for it: a boot takes seconds, an apply under emulation minutes.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from vm.bench import Bench
from vm.emulator import has_kvm
from vm.guest import Guest
from vm.places import ARCHITECTURES, places
from vm.rig import RigBench
from vm.user import APPLY_SECONDS, McpClient, Octoform

_SEEN = pytest.StashKey[list[tuple[str, str, str]]]()
See = Callable[[str, str], None]
_RIG_MANIFEST = """\
profiles: [profiles/so-arm101.md, profiles/camera-rail.md]
answers: {usb-2341-804f: "the camera rail of the bench"}
privileged_steps: [arm, rail, perceive]
"""


def pytest_configure(config: pytest.Config) -> None:
    """A list for what is seen."""
    config.stash[_SEEN] = []


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave these tests out of every other run."""
    return None if config.getoption("markexpr") == "vm" else True


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """The table of what was checked."""
    seen = terminalreporter.config.stash.get(_SEEN, [])
    if seen:
        terminalreporter.section("on real kernels")
    for arch, what, text in seen:
        terminalreporter.write_line(f"{arch:6} {what:22} {text}")


@pytest.fixture(scope="session", params=ARCHITECTURES)
def arch(request: pytest.FixtureRequest) -> str:
    """The architecture of the guests; all tests of one come before those of the next."""
    name: str = request.param
    assert places(name).root.exists(), f"no guest in {places(name).folder}; `make vm` makes it"
    request.config.stash[_SEEN].append(
        (name, "processor", "this machine's, by KVM" if has_kvm(name) else "in software")
    )
    return name


@pytest.fixture(scope="module")
def bench(arch: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """A guest with all its hardware attached."""
    folder = tmp_path_factory.mktemp(f"vm-{arch}")
    extra: tuple[str, ...] = ()
    if arch == "arm64":
        image = folder / "nvme.img"
        with image.open("wb") as file:
            file.truncate(8 << 20)
        drive = f"if=none,id=stick,file={image},format=raw"
        extra = ("-drive", drive, "-device", "nvme,drive=stick,serial=N0000017")
    with Guest(places(arch), extra) as guest:
        bench = Bench(guest, folder)
        bench.attach()
        yield bench


@pytest.fixture
def see(request: pytest.FixtureRequest, arch: str) -> See:
    """Note what a test saw, for the table."""
    return lambda what, said: request.config.stash[_SEEN].append((arch, what, said))


@pytest.fixture(scope="module")
def first_plan(bench: Bench) -> str:
    """What a person sees before anything was done."""
    octoform = Octoform(bench.guest)
    octoform.install("profiles: [profiles/camera-rail.md]\n")
    return octoform.run("plan")


@pytest.fixture(scope="module")
def octoform(bench: Bench, first_plan: str) -> Octoform:
    """octoform in the guest, applied by the embedded agent, with nothing answered."""
    octoform = Octoform(bench.guest)
    octoform.run("apply", "-auto-approve", seconds=APPLY_SECONDS)
    return octoform


@pytest.fixture(scope="module")
def answered(octoform: Octoform) -> Octoform:
    """The same after one sentence about the board that no one could know."""
    octoform.run("answer", "usb-2341-804f", "the camera rail of the bench")
    octoform.run("apply", "-auto-approve", seconds=APPLY_SECONDS)
    return octoform


@pytest.fixture(scope="module")
def rig_bench(arch: str) -> Iterator[RigBench]:
    """A guest of its own with the reference rig and nothing else."""
    with Guest(places(arch)) as guest:
        bench = RigBench(guest)
        bench.attach()
        yield bench


@pytest.fixture(scope="module")
def rigged(rig_bench: RigBench) -> Octoform:
    """octoform in the rig's guest, applied by the embedded agent."""
    octoform = Octoform(rig_bench.guest)
    octoform.install(_RIG_MANIFEST)
    octoform.run("apply", "-auto-approve", seconds=APPLY_SECONDS)
    return octoform


@pytest.fixture(scope="module")
def client(rigged: Octoform) -> Iterator[McpClient]:
    """An MCP client that stays connected to the rig's endpoint, whatever is pulled meanwhile."""
    with rigged.connected() as client:
        yield client
