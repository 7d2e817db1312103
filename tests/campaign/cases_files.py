"""Faults of what the endpoint stands on: accepted artifacts, published files, the environment, the state."""

import shutil
from collections.abc import Callable
from pathlib import Path

from campaign.bench import Bench
from campaign.cases_process import end
from campaign.model import SURFACED, Case

from octoform.daemon.model import Kind, Repair
from octoform.endpoint.environment.model import at, intact

FILE, STATE = frozenset({Kind.FILE_DAMAGED}), frozenset({Kind.STATE_DAMAGED})
PACKAGE = frozenset({Kind.PACKAGE_DAMAGED, Kind.PACKAGE_CONFLICT})
RESTORED, PUBLISHED = frozenset({Repair.RESTORE, Repair.RESTART}), frozenset({Repair.REPUBLISH, Repair.RESTART})
REBUILT = frozenset({Repair.REBUILD, Repair.RESTART})
Damage = Callable[[Path], object]


def whole(bench: Bench) -> bool:
    """Everything has the bytes that it had before the fault, and the endpoint serves."""
    return bench.protected() == bench.before and bench.serves()


def sound(bench: Bench) -> bool:
    """The environment is what was built, and the endpoint serves from it."""
    environment = at(bench.environment())
    return (
        environment is not None
        and not intact(environment)
        and bench.serves()
        and bench.call("ask_board", device="usb-1f00-00b1")[0]
    )


def _half(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def _torn(path: Path) -> None:
    path.write_text(path.read_text() + "\ndef broken(:\n")


def _linked(path: Path) -> None:
    other = path.parents[3] / "elsewhere.txt"
    other.write_bytes(path.read_bytes())
    path.unlink()
    path.symlink_to(other)


def _gone(path: Path) -> None:
    shutil.rmtree(path) if path.is_dir() else path.unlink()


def _harmless(path: Path) -> None:
    """The same JSON in other bytes."""
    path.write_bytes(path.read_bytes() + b"\n")


EDITED = "state/bench/interface/output.json"


def _edited(bench: Bench) -> None:
    path = bench.project.folder / EDITED
    before = path.read_bytes()
    bench.undo.append(lambda: path.write_bytes(before))
    _harmless(path)


def accepted(name: str, path: str, damage: Damage, rows: str = "", stopped: bool = False) -> Case:
    """Damage to an accepted artifact; with ``stopped`` the endpoint is killed as well."""

    def inject(bench: Bench) -> None:
        damage(bench.layout.committed / path)
        if stopped:
            end(bench)

    # What a damaged accepted artifact needs is the accepted one; a start waits for it.
    return Case(
        name,
        inject,
        FILE | {Kind.PROCESS_DEAD},
        RESTORED,
        right=whole,
        rows=rows,
        repair=10.0,
    )


def published(name: str, path: str, damage: Damage) -> Case:
    """Damage to a file of the endpoint itself."""

    def inject(bench: Bench) -> None:
        damage(bench.layout.endpoint / path)

    return Case(name, inject, FILE, PUBLISHED | RESTORED, right=whole, repair=15.0)


def environment(name: str, damage: Callable[[Bench], object], stopped: bool = False) -> Case:
    """Damage to the serving environment."""

    def inject(bench: Bench) -> None:
        damage(bench)
        if stopped:
            end(bench)

    return Case(name, inject, PACKAGE | {Kind.PROCESS_DEAD}, REBUILT, right=sound, repair=15.0)


def _without(bench: Bench, pattern: str) -> None:
    for path in bench.packages().glob(pattern):
        _gone(path)


def _inner(bench: Bench) -> None:
    """A file of a library that the start needs."""
    next(iter(bench.packages().glob("pydantic/main.py"))).unlink()


def _two_providers(bench: Bench) -> None:
    """Another distribution with the same module is installed over the locked one, and breaks it."""
    packages = bench.packages()
    info = packages / "annotated_types_full-9.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: annotated-types-full\nVersion: 9.0\n")
    (info / "RECORD").write_text("annotated_types/__init__.py,,\nannotated_types_full-9.0.dist-info/METADATA,,\n")
    module = packages / "annotated_types" / "__init__.py"
    module.unlink()  # as every installer does; written in place it would also be in the package tool's cache
    module.write_text("raise ImportError('no graphical system')\n")


def _upgraded(bench: Bench) -> None:
    found = next(iter(bench.packages().glob("annotated_types-*.dist-info")))
    found.rename(found.with_name("annotated_types-99.0.dist-info"))


def _no_interpreter(bench: Bench) -> None:
    (bench.environment() / "bin" / "python").unlink()


def _no_environment(bench: Bench) -> None:
    gone = bench.project.outside / "environment"
    bench.environment().rename(gone)  # at once: what is removed piece by piece is built again meanwhile
    bench.undo.append(lambda: shutil.rmtree(gone))


def _of_person(name: str, path: str, damage: Damage) -> Case:
    """Damage that the daemon must not mend by itself: it is said, and nothing else is touched."""

    def inject(bench: Bench) -> None:
        target = bench.project.folder / path
        before = target.read_bytes()
        bench.undo.append(lambda: target.write_bytes(before))
        damage(target)

    def mend(bench: Bench) -> None:
        bench.undo.pop()()

    return Case(name, inject, STATE, frozenset({Repair.PERSON}), ends=SURFACED, mend=mend)


def _served_through(bench: Bench) -> None:
    """The manifest breaks, and then the endpoint dies: what is accepted goes on being served."""
    path = bench.project.folder / "octopus.yaml"
    before = path.read_bytes()
    bench.undo.append(lambda: path.write_bytes(before))
    path.write_text("version: [1\n")
    end(bench)


def _not_executable(path: Path) -> None:
    path.chmod(0o600)


CASES = (
    accepted("server.py cut in half", "serve/server.py", _half, "F15 F40"),
    accepted("server.py with a syntax error, endpoint dead", "serve/server.py", _torn, "F15", stopped=True),
    accepted("server.py is a link", "serve/server.py", _linked, "F40"),
    accepted("server.py deleted", "serve/server.py", _gone),
    accepted("server.py emptied, endpoint dead", "serve/server.py", lambda path: path.write_text(" \n"), stopped=True),
    accepted("runtime module changed", "serve/runtime/devices.py", _torn),
    accepted("runtime module deleted, endpoint dead", "serve/runtime/devices.py", _gone, stopped=True),
    accepted("runtime folder deleted", "serve/runtime", _gone),
    Case(
        "interface artifact edited",
        _edited,
        FILE,
        frozenset({Repair.RESTORE, Repair.PERSON}),
        SURFACED,
        # An edit may be a person's: it is said, and stays.
        mend=lambda bench: bench.undo.pop()(),
        may_change=(EDITED,),
        rows="F41",
    ),
    accepted("requirements deleted", "deploy/requirements.txt", _gone),
    published("launcher deleted", "launch", _gone),
    published("launcher not executable", "launch", _not_executable),
    published("connection descriptor edited", "connection.json", _harmless),
    published("policy deleted", "policy.json", _gone),
    published("endpoint's manifest deleted", "manifest.json", _gone),
    published("endpoint's manifest damaged", "manifest.json", _half),
    environment("package removed", lambda bench: _without(bench, "annotated_types*")),
    environment("module of a package removed", lambda bench: _without(bench, "annotated_types")),
    environment("file inside a package removed, endpoint dead", _inner, stopped=True),
    environment("two distributions provide one module", _two_providers),
    environment("package replaced behind the back", _upgraded),
    environment("interpreter gone", _no_interpreter, stopped=True),
    environment("environment gone", _no_environment),
    _of_person("state file cut off", "state/bench/state.json", _half),
    _of_person(
        "state file of another format", "state/bench/state.json", lambda path: path.write_text('{"format": 999}')
    ),
    _of_person("manifest broken", "octopus.yaml", lambda path: path.write_text("version: [1\n")),
    Case(
        "endpoint dies while the manifest is broken",
        _served_through,
        frozenset({Kind.PROCESS_DEAD}),
        frozenset({Repair.RESTART, Repair.PERSON}),
        mend=lambda bench: bench.undo.pop()(),
        detect=1.0,
        repair=5.0,
        may_change=("octopus.yaml",),
    ),
)
