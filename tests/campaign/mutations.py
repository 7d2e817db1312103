"""Damaged files: every file of a host, spoilt in every way, and what the commands of a person make of it.

``python -m campaign.mutations [--mutations N] [--seed S] [--only WORDS] [--seconds S]`` with ``tests`` and
``tests/support`` on the path. After each mutation plan, status, health, tools, devices, clients and apply are run as a
person would, from a process that has loaded octoform already. None may end in a traceback or take longer than its time;
behind apply the host is as it was, or apply has said in a sentence why not.
"""

import argparse
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import warm
from projects import OCTOFORM, Project

LOOKS = (("plan",), ("status",), ("health",), ("tools",), ("devices",), ("clients",))
APPLY = ("apply", "-auto-approve")
SECONDS = 5.0
"""For a command that looks; `apply` may build, start and check an endpoint besides, which has its own time."""
APPLY_SECONDS = 60.0
_SKIPPED = re.compile(r"(^|/)(environments|__pycache__|attempts)(/|$)|\.lock$|\.guard$|\.sock$")
_JSON: tuple[Any, ...] = (None, True, -1, 1e308, "", "a\0b", "\ud800", [], {}, [[]], {"": {}}, "../../etc/passwd")


def truncate(path: Path, data: bytes, chance: random.Random) -> None:
    """Cut off anywhere, also to nothing."""
    path.write_bytes(data[: chance.randrange(len(data) + 1) if chance.random() < 0.8 else 0])


def flip(path: Path, data: bytes, chance: random.Random) -> None:
    """A few bytes are others."""
    spoilt = bytearray(data or b"x")
    for _ in range(chance.randint(1, 8)):
        spoilt[chance.randrange(len(spoilt))] = chance.randrange(256)
    path.write_bytes(bytes(spoilt))


def swap(path: Path, data: bytes, chance: random.Random) -> None:
    """One value of a JSON document is of another type; another file becomes such a value."""
    try:
        document = json.loads(data)
    except ValueError:
        document = None
    places = list(_places(document))
    if places:
        holder, key = chance.choice(places)
        holder[key] = chance.choice(_JSON)
    else:
        document = chance.choice(_JSON)
    path.write_text(json.dumps(document), encoding="utf-8")


def nest(path: Path, data: bytes, chance: random.Random) -> None:
    """Brackets without end, alone or in the place of a value."""
    if chance.random() < 0.5:
        path.write_bytes(b"[" * 200_000)
        return
    try:
        document = json.loads(data)
    except ValueError:
        document = {}
    places = list(_places(document))
    if places:
        holder, key = chance.choice(places)
        holder[key] = "@@"
    deep = "[" * 900 + "]" * 900
    path.write_text(json.dumps(document).replace('"@@"', deep, 1), encoding="utf-8")


def pipe(path: Path, data: bytes, chance: random.Random) -> None:
    """A pipe that nobody writes to."""
    path.unlink()
    os.mkfifo(path)


def link(path: Path, data: bytes, chance: random.Random) -> None:
    """A link to nothing, to itself, to a device, or to the same bytes elsewhere."""
    path.unlink()
    target = chance.choice(["nothing", path.name, "/dev/zero", "same"])
    if target == "same":
        elsewhere = Path(tempfile.mkdtemp(prefix="octoform-elsewhere-")) / path.name
        elsewhere.write_bytes(data)
        target = str(elsewhere)
    path.symlink_to(target)


def folder(path: Path, data: bytes, chance: random.Random) -> None:
    """A folder, empty or not."""
    path.unlink()
    path.mkdir()
    if chance.random() < 0.5:
        (path / "file").write_bytes(data)


def nul(path: Path, data: bytes, chance: random.Random) -> None:
    """NUL bytes in the middle, or escaped in a text."""
    at = chance.randrange(len(data) + 1)
    quoted = [match.end() for match in re.finditer(rb'[:\[] *"', data)]
    if quoted and chance.random() < 0.6:
        at = chance.choice(quoted)
        path.write_bytes(data[:at] + b"\\u0000" + data[at:])
    else:
        path.write_bytes(data[:at] + b"\0" * chance.randint(1, 64) + data[at:])


MUTATIONS: tuple[Callable[[Path, bytes, random.Random], None], ...] = (
    truncate,
    flip,
    swap,
    nest,
    pipe,
    link,
    folder,
    nul,
)


def _places(document: Any) -> Iterator[tuple[Any, Any]]:
    """Every (holder, key) below a document."""
    left = [document]
    while left:
        holder = left.pop()
        if isinstance(holder, dict | list):
            for key in list(holder) if isinstance(holder, dict) else range(len(holder)):
                yield holder, key
                left.append(holder[key])


@dataclass
class Case:
    """A mutation and what came of it; ``wrong`` is empty where all is as promised."""

    file: str
    mutation: str
    number: int
    told: str = ""
    wrong: list[str] = field(default_factory=list)


class Subject:
    """An applied project whose files are spoilt one after the other; put back as a whole where apply cannot."""

    def __init__(self, project: Project, seconds: float = SECONDS, apply_seconds: float = APPLY_SECONDS) -> None:
        self.project, self._seconds, self._apply_seconds = project, seconds, apply_seconds
        self._printed = ""
        self._kept = Path(tempfile.mkdtemp(prefix="octoform-kept-"))
        self.keep()

    def keep(self) -> None:
        """What is there now is what is put back."""
        for path in self.files():
            kept = self._kept / path.relative_to(self.project.folder)
            kept.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, kept)

    def close(self) -> None:
        """Remove the copies."""
        shutil.rmtree(self._kept)

    def files(self) -> list[Path]:
        """The files that are spoilt, in order."""
        found = []
        for top in (self.project.state, self.project.local):
            for path in sorted(top.rglob("*")):
                inside = path.relative_to(self.project.folder).as_posix()
                if path.is_file() and not path.is_symlink() and not _SKIPPED.search(inside):
                    found.append(path)
        return found

    def spoil(self, inside: str, number: int, seed: int) -> Case:
        """One mutation of a file, and all commands behind it."""
        chance = random.Random(f"{seed}:{inside}:{number}")
        order = random.Random(f"{seed}:{inside}").sample(MUTATIONS, len(MUTATIONS))
        mutation = order[number % len(order)]
        return self.judge(
            Case(inside, mutation.__name__, number), lambda path: mutation(path, path.read_bytes(), chance)
        )

    def judge(self, case: Case, spoils: Callable[[Path], None]) -> Case:
        """What all commands make of a file that was spoilt in this way."""
        path = self.project.folder / case.file
        if not path.is_file() or path.is_symlink():
            self.restore()
        spoils(path)
        for command in LOOKS:
            self._run(case, command, self._seconds)
        status = self._run(case, APPLY, self._apply_seconds)
        case.told = "recovered" if status == 0 else case.told or "nothing"
        after = self._run(case, ("plan", "-detailed-exitcode"), self._seconds)
        if status == 0 and after != 0:
            reasons = [line.strip() for line in self._printed.splitlines() if line.startswith("        ")]
            case.wrong.append(f"plan ends with {after} behind an apply that went well: {'; '.join(reasons)[:200]}")
        if after != 0:
            self.restore()
        return case

    def _run(self, case: Case, command: Sequence[str], seconds: float) -> int | None:
        """The exit status; what is wrong with how it ended stands in the case."""
        name = command[0]
        try:
            status, out, err = warm.run(OCTOFORM, command, self.project.folder, self.project.environment(), seconds)
        except subprocess.TimeoutExpired:
            case.wrong.append(f"{name}: not done after {seconds:g} s")
            return None
        text = self._printed = out + err
        if "Traceback" in text:
            last = [line for line in text.splitlines() if line.strip()][-1]
            where = [line.strip() for line in text.splitlines() if line.strip().startswith("File ")][-1:]
            case.wrong.append(f"{name}: {last[:160]} {' '.join(where)[-120:]}")
        elif status not in (0, 2) and not text.strip():
            case.wrong.append(f"{name}: ends with {status} and says nothing")
        if name == APPLY[0]:
            case.told = next((line.strip() for line in err.splitlines() if line.strip()), "")[:160]
        return status

    def restore(self) -> None:
        """Everything as it was kept, and no process of the endpoint."""
        self.project.run("stop")
        for top in (self.project.state, self.project.local):
            for path in sorted(top.rglob("*"), reverse=True):
                inside = path.relative_to(self.project.folder)
                if _SKIPPED.search(inside.as_posix()) or (path.is_symlink() and path.name == "environments"):
                    continue
                if not path.is_symlink() and path.is_dir():
                    if (self._kept / inside).is_file():
                        shutil.rmtree(path)
                else:
                    path.unlink()
        shutil.copytree(self._kept, self.project.folder, dirs_exist_ok=True)
        self.project.run("start")


def spoilt(subject: Subject, mutations: int, seed: int, only: Sequence[str] = ()) -> Iterator[Case]:
    """Each file of the subject so many times, in turns, so that a run that is cut off has seen every file."""
    names = [path.relative_to(subject.project.folder).as_posix() for path in subject.files()]
    names = [name for name in names if not only or any(word in name for word in only)]
    for number in range(mutations):
        for name in names:
            yield subject.spoil(name, number, seed)


def campaign(folder: Path, mutations: int, seed: int, only: Sequence[str], seconds: float) -> list[Case]:
    """Spoil a watched deployment; each case is printed as it is done."""
    from campaign.making import made

    bench = made("intranet", folder)
    try:
        bench.end_daemon()
        subject = Subject(bench.project, seconds)
        try:
            cases = []
            for case in spoilt(subject, mutations, seed, only):
                cases.append(case)
                print(f"{case.number} {case.mutation:8} {case.file}: {'; '.join(case.wrong) or case.told}", flush=True)
            return cases
        finally:
            subject.close()
    finally:
        bench.close()


def main() -> int:
    """0 when nothing went wrong."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that the bench is closed
    parser = argparse.ArgumentParser()
    parser.add_argument("--mutations", type=int, default=200, help="of each file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="what a command that looks may take")
    parser.add_argument("--only", nargs="*", default=[], help="files with one of these words in their names")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="octoform-mutations-") as place:
        cases = campaign(Path(place), given.mutations, given.seed, given.only, given.seconds)
    wrong = [case for case in cases if case.wrong]
    recovered = sum(case.told == "recovered" for case in cases)
    print(f"{len(cases)} mutations: {recovered} recovered, {len(cases) - recovered} told, {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
