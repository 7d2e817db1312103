"""Build the environment that nearly every server needs while the agents still work on the first stages.

The first import of freshly installed packages costs two CPU seconds of compiling, which would otherwise stand at the
end of a first apply, when a person waits for the endpoint. It is a guess and never more: nothing rests on it, and
what fails here fails again, and is told, where it counts.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Thread

from octoform.base import shortage
from octoform.base.locks import held
from octoform.endpoint.bounded_program import base_environment, run
from octoform.endpoint.environment.build import build
from octoform.endpoint.environment.lockfile import resolve
from octoform.endpoint.environment.model import FOLDER_NAME, at, intact
from octoform.state.layout import Layout

GUESS = ("fastmcp>=4.1,<4.2",)
"""What the SERVE spec asks of every server; further packages differ from host to host."""
SCRIPT = Path(__file__).parents[1] / "scripts" / "warm.py"
SECONDS = 120.0
COMPILING = ".compiling.lock"


@contextmanager
def prewarmed(layout: Layout, requirements: Sequence[str] = GUESS) -> Iterator[None]:
    """Prepare an environment beside the work of the block, unless this host has one; ends with the block.

    The block's end waits for what is under way (bounded), so that nothing is left running.
    """
    if has_environment(layout):
        yield
        return
    worker = Thread(target=_attempt, args=(layout, requirements), name="prewarming")
    try:
        shortage.start(worker)
    except BlockingIOError:  # where it counts, the same shortage is reported
        yield
        return
    try:
        yield
    finally:
        worker.join()


def _attempt(layout: Layout, requirements: Sequence[str]) -> None:
    with suppress(OSError):  # it fails again, and is reported, where it counts
        prepare(layout, requirements)


def prepare(layout: Layout, requirements: Sequence[str]) -> bool:
    """Lock, build, compile; True when all of it went through."""
    lock, _ = resolve(requirements, layout.project, timeout=SECONDS)
    if lock is None:
        return False
    environment, _ = build(layout, lock, SECONDS)
    if environment is None:
        return False
    command = [str(environment.python), "-I", str(SCRIPT)]
    with held(layout.environments / COMPILING):
        return run(command, cwd=environment.path, environment=base_environment(), timeout=SECONDS).status == 0


def await_bytecode(layout: Layout) -> None:
    """Wait for a compiling that is under way (bounded, as that is): an import beside it would do all of it again."""
    path = layout.environments / COMPILING
    if path.is_file():
        with held(path, shared=True):
            return


def has_environment(layout: Layout) -> bool:
    """True when at least one complete and unchanged environment is there."""
    found = (at(path) for path in layout.environments.glob("*") if FOLDER_NAME.fullmatch(path.name))
    return any(environment is not None and not intact(environment) for environment in found)
