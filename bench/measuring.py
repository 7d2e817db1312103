"""How the benchmarks measure: CPU seconds of a command with all its children, in interleaved rounds, held to a bound.

Wall time on a shared machine says little, CPU seconds say what the work costs; so commands that are compared run in
turns within one run, and the median of the rounds counts. A bound in CPU seconds is that of a machine on which Python
starts in ``START`` seconds: one and the same machine differs by half from one day to the next. A bound that does not
hold makes the benchmark fail.
"""

import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BIN = Path(sys.executable).parent
OCTOFORM = str(BIN / "octoform")
PYTHON = sys.executable
SUPPORT = ROOT / "tests" / "support"
START = 0.011
"""CPU seconds of ``python -c pass`` where the bounds were set."""
KEPT = (
    "PATH",
    "HOME",
    "LANG",
    "UV_CACHE_DIR",
    "UV_INDEX_URL",
    "UV_DEFAULT_INDEX",
    "SSL_CERT_FILE",
    "PIP_CERT",
    "OCTOFORM_SYSROOT",
)
HEAVY = ("fastmcp", "litellm", "cv2", "git", "pydantic", "ruamel", "jsonschema", "jinja2", "rich")


@dataclass(frozen=True)
class Cost:
    """One run: CPU seconds of the process and all children it waited for, wall seconds, exit status."""

    cpu: float
    wall: float
    status: int


@dataclass(frozen=True)
class Command:
    """Something to measure: a title, the arguments, the working folder."""

    title: str
    argv: Sequence[str]
    folder: Path


@dataclass(frozen=True)
class Row:
    """One line of a result: what, its value in ``unit``, and the bound that it must keep (None: for comparison)."""

    title: str
    value: float
    unit: str = "s CPU"
    bound: float | None = None
    note: str = ""

    def limit(self) -> float:
        """The bound on this machine, in ``unit``; infinite without one."""
        if self.bound is None:
            return math.inf
        return self.bound * (slowness() if self.unit == "s CPU" else 1.0)

    def holds(self) -> bool:
        """False when there is a bound and the value is above it."""
        return self.value <= self.limit()


def environment(extra: Mapping[str, str] | None = None) -> dict[str, str]:
    """The variables that a measured command sees."""
    found = {name: os.environ[name] for name in KEPT if name in os.environ}
    return {**found, "TF_PLUGIN_CACHE_DIR": "", "CHECKPOINT_DISABLE": "1", **(extra or {})}


def cost(command: Command) -> Cost:
    """Run a command once to its end; its output is dropped."""
    began = time.monotonic()
    process = subprocess.Popen(
        list(command.argv),
        cwd=command.folder,
        env=environment(),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return Cost(used.ru_utime + used.ru_stime, time.monotonic() - began, process.returncode)


def in_turns(commands: Sequence[Command], rounds: int) -> dict[str, float]:
    """Median CPU seconds by title; every round runs each command once, after one round that is not counted."""
    found: dict[str, list[float]] = {command.title: [] for command in commands}
    for number in range(rounds + 1):
        for command in commands:
            measured = cost(command)
            if measured.status != 0:
                raise SystemExit(f"{command.title}: exit status {measured.status}")
            if number:
                found[command.title].append(measured.cpu)
    return {title: statistics.median(values) for title, values in found.items()}


def imported(argv: Sequence[str], folder: Path) -> list[str]:
    """Which of the heavy libraries an octoform command imports, as the interpreter's own log of imports tells."""
    command = [PYTHON, "-X", "importtime", OCTOFORM, *argv]
    done = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True, check=True)
    names = {line.rpartition("|")[2].strip().partition(".")[0] for line in done.stderr.splitlines()}
    return sorted(names & set(HEAVY))


def slowness() -> float:
    """How many times longer than ``START`` Python's start takes: the median of all that this process has timed."""
    if not _starts:
        _time_starts(7)
    return statistics.median(_starts) / START


_starts: list[float] = []


def _time_starts(count: int) -> None:
    """Time so many starts of Python, after a first one that reads the disk and does not count."""
    bare = Command("python -c pass", [PYTHON, "-c", "pass"], ROOT)
    _starts.extend([cost(bare).cpu for _ in range(count + 1)][1:])


@contextmanager
def scratch() -> Iterator[Path]:
    """A folder that is gone afterwards, with the endpoints that were started in it."""
    sys.path.insert(0, str(SUPPORT))
    from endings import end_endpoints

    _time_starts(3)
    folder = Path(tempfile.mkdtemp(prefix="octoform-bench-"))
    try:
        yield folder
    finally:
        end_endpoints(folder)
        shutil.rmtree(folder)


def report(name: str, rows: Sequence[Row], base: Row | None = None, said: Sequence[str] = ()) -> int:
    """Print the rows, each as a ratio of ``base`` too; 1 when a bound does not hold, else 0."""
    print(name)
    for row in rows:
        ratio = f"{row.value / base.value:6.2f} x" if base and base.value and row.unit == base.unit else ""
        print(f"  {row.title:<44} {_number(row):>9} {row.unit:<6} {ratio:>9}  {_verdict(row)}".rstrip())
    for text in said:
        print(f"  {text}")
    if any(row.bound is not None and row.unit == "s CPU" for row in rows):
        print(
            f"  Python starts in {slowness() * START:.4f} s CPU here: bounds in s CPU are those of {START} s times "
            f"{slowness():.2f}"
        )
    print()
    return 0 if all(row.holds() for row in rows) else 1


def _number(row: Row) -> str:
    return f"{row.value:,.0f}" if row.unit in ("bytes", "") else f"{row.value:.3f}"


def _verdict(row: Row) -> str:
    if row.bound is None:
        return row.note
    bound = f"{row.limit():,.0f}" if row.unit in ("bytes", "") else f"{row.limit():.3f}"
    return f"at most {bound}: {'holds' if row.holds() else 'MISSED'}{', ' + row.note if row.note else ''}"
