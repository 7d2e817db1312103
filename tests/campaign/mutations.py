"""Damaged files: every kind of file of a host, damaged in every way, and what the commands of a person make of it.

``python -m campaign.mutations [--mutations N] [--seed S] [--only WORDS] [--seconds S] [--workers W] [--applies A]``
with ``tests`` and ``tests/support`` on the path. Files that octoform reads in the same way are one kind (`kind_of`); a
mutation takes another file of the kind. After each mutation plan, status, health, tools and one of the other commands
are run as a person would, from a process that has loaded octoform already. None may end in a traceback, speak in the
words of the kernel or of Python, or take longer than its time.

Then `apply` is run: behind it the host is as it was, or apply has reported in a sentence why not. An apply that makes
the endpoint again costs ten times what the rest does. Where the commands have made the same of the same damage to the
same kind of file for ``--applies`` times, such an apply is left out and the file is put back.
"""

import argparse
import concurrent.futures
import os
import random
import re
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import warm
from campaign.spoiling import MUTATIONS
from projects import OCTOFORM, Project

from octoform.endpoint.environment.model import MARKER

LOOKS = (("plan",), ("status",), ("health",), ("tools",))
OTHERS = (
    *(
        ("devices", "-v"),
        ("clients",),
        ("coverage",),
        ("attempts",),
        ("attempts", "show", "4"),
        ("audit",),
        ("limits",),
    ),
    *(("claims", "-all"), ("incidents",), ("logs",), ("token", "list"), ("state", "list"), ("show",)),
    *(("answer",), ("spec", "diff"), ("doctor",), ("call",), ("validate",), ("graph",), ("health", "-json")),
    *(("status", "--json"), ("plan", "--json"), ("look",), ("token", "show", "default")),
)
APPLY = ("apply", "-auto-approve")
SECONDS = 5.0
"""For a command that looks; `apply` may build, start and check an endpoint besides, which has its own time."""
APPLY_SECONDS = 60.0
APPLIES = 2
PORT = 17777
_SKIPPED = re.compile(r"(^|/)__pycache__(/|$)|environments/[^/]+/(?!octoform-complete\.json$)|\.lock$|\.guard$|\.sock$")
_READ_AT_START = re.compile(r"/(run|log)/")
"""Files that the endpoint's process opens when it starts, and may hold open."""
_GROWS = re.compile(r"(^|/)(environments|attempts)(/|$)")
_KINDS = (
    (re.compile(r"/attempts/.*?/(import/|former-)?runtime/.*"), "/attempts/*/runtime/*"),
    (re.compile(r"/attempts/[^/]+/"), "/attempts/*/"),
    (re.compile(r"/serve/runtime/.*"), "/serve/runtime/*"),
    (re.compile(r"/endpoint/octoform/.*"), "/endpoint/octoform/*"),
    (re.compile(r"/clients/[^/]+\.json$"), "/clients/*.json"),
    (re.compile(r"/kept/[0-9a-f]{64}$"), "/kept/*"),
    (re.compile(r"/frames/[^/]+\.(png|jpg)$"), "/frames/*"),
    (re.compile(r"/environments/[^/]+/"), "/environments/*/"),
)
_FOREIGN = re.compile(
    r"Traceback|\[Errno|codec can't|levels of symbolic|NoneType|object (is not|has no)|(list|tuple|str) (index|indices)"
    r"|unhashable|Error: |invalid literal|not supported between|unexpected keyword|Input should"
)
"""What no sentence of octoform holds: the words of Python and of the kernel."""
_QUOTES = ("incidents", "logs", "attempts", "attempts show 4")
"""Commands that quote what servers and agents printed."""
_QUOTED = re.compile(r"\w fails: ")
"""A finding about a tool that fails, which every command quotes with the tool's own error."""
_TOOL_FAILED = re.compile(r"octoform: reference [0-9a-f]{8}: the tool \S+ failed inside$")
_CHAINED = re.compile(r"(The above exception was|During handling of the above)")


def kind_of(inside: str) -> str:
    """The kind of a file: the files of one kind are written and read by the same code."""
    for pattern, name in _KINDS:
        inside = pattern.sub(name, inside)
    return inside


def bare_tracebacks(printed: str) -> list[str]:
    """The last line of each traceback that is the endpoint's own; one of a tool's stands under its reference."""
    found, within = [], False
    before = ""
    for line in filter(str.strip, printed.splitlines()):
        if "Traceback (most recent call last)" in line:
            within = not (_TOOL_FAILED.search(before) or (not within and _CHAINED.match(before)))
        elif within and not line.startswith((" ", "\t")) and not _CHAINED.match(line):
            found.append(line.strip())
            within = False
        before = line
    return found + (["a traceback without an end"] if within else [])


def foreign_lines(printed: str) -> list[str]:
    """The lines in words of Python or of the kernel, but for those that quote a tool."""
    return [line for line in printed.splitlines() if _FOREIGN.search(line) and not _QUOTED.search(line)]


@dataclass
class Case:
    """A mutation and what came of it; ``wrong`` is empty where all is as promised."""

    file: str
    mutation: str
    number: int
    told: str = ""
    wrong: list[str] = field(default_factory=list)
    read: list[str] = field(default_factory=list)
    """What the commands that look printed, without figures."""


class Subject:
    """An applied project whose files are damaged one after the other; put back as a whole where apply cannot."""

    def __init__(
        self,
        project: Project,
        seconds: float = SECONDS,
        apply_seconds: float = APPLY_SECONDS,
        applies: int | None = None,
    ) -> None:
        self.project, self._seconds, self._apply_seconds, self._applies = project, seconds, apply_seconds, applies
        self._seen: Counter[tuple[str, ...]] = Counter()
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
        """The files that are damaged, in order."""
        found = []
        for top in (self.project.state, self.project.local, *self.project.local.glob("environments")):
            for path in sorted(top.rglob("*")):
                inside = path.relative_to(self.project.folder).as_posix()
                if path.is_file() and not path.is_symlink() and not _SKIPPED.search(inside):
                    found.append(path)
        return found

    def kinds(self) -> dict[str, list[str]]:
        """The files by kind."""
        found: dict[str, list[str]] = {}
        for path in self.files():
            inside = path.relative_to(self.project.folder).as_posix()
            found.setdefault(kind_of(inside), []).append(inside)
        return found

    def spoil(self, inside: str, number: int, seed: int) -> Case:
        """One mutation of a file, and all commands behind it."""
        kind = kind_of(inside)
        chance = random.Random(f"{seed}:{kind}:{number}")
        order = random.Random(f"{seed}:{kind}").sample(MUTATIONS, len(MUTATIONS))
        mutation = order[number % len(order)]
        return self.judge(
            Case(inside, mutation.__name__, number), lambda path: mutation(path, path.read_bytes(), chance)
        )

    def look(self, case: Case, spoils: Callable[[Path], object]) -> Case:
        """What the commands that look make of a file that was damaged in this way; it is put back as it was."""
        path = self.project.folder / case.file
        aside = path.with_name(f"{path.name}.aside")
        shutil.copy2(path, aside)
        printed = self._printed()
        try:
            spoils(path)
            self._look(case)
        finally:
            aside.replace(path)
        self._judge_printed(case, printed)
        return case

    def _look(self, case: Case) -> None:
        for command in (*LOOKS, OTHERS[(case.number + len(case.file)) % len(OTHERS)]):
            self._run(case, command, self._seconds)

    def judge(self, case: Case, spoils: Callable[[Path], object]) -> Case:
        """What all commands make of a file that was damaged in this way."""
        path = self.project.folder / case.file
        if self._stands(path) or not path.exists():
            self.restore()
        spoils(path)
        printed = self._printed()
        self._look(case)
        if self._is_known(case):
            self._judge_printed(case, printed)
            self.put_back(case.file)
            return case
        status = self._run(case, APPLY, self._apply_seconds)
        case.told = case.told or "nothing"
        after = self._run(case, ("plan", "-detailed-exitcode"), self._seconds)
        if status == 0 and after != 0:
            reasons = [line.strip() for line in case.read[-1].splitlines() if line.startswith("        ")]
            case.wrong.append(f"plan ends with {after} behind an apply that went well: {'; '.join(reasons)[:200]}")
        if self._stands(path) and _READ_AT_START.search(case.file):
            self._run(case, ("restart",), self._apply_seconds)
        self._judge_printed(case, printed)
        if after != 0 or self._stands(path):
            self.restore()
        return case

    @staticmethod
    def _stands(path: Path) -> bool:
        """Whether something that is no file is still in its place: who has the file open does not see that."""
        return os.path.lexists(path) and not stat.S_ISREG(path.lstat().st_mode)

    def _printed(self) -> tuple[int, int]:
        """The log of the endpoint's process as it is: which file, and its length."""
        log = self.project.local / "log/server.log"
        if log.is_symlink() or not log.is_file():
            return 0, 0
        return log.stat().st_ino, log.stat().st_size

    def _judge_printed(self, case: Case, before: tuple[int, int]) -> None:
        """What the endpoint's process has printed since; `logs` quotes it, also what is older."""
        inode, size = self._printed()
        if inode:
            printed = (self.project.local / "log/server.log").read_bytes()
            new = printed[before[1] :] if inode == before[0] and size >= before[1] else printed
            case.wrong += [
                f"the endpoint printed: {text}" for text in bare_tracebacks(new.decode(errors="replace"))[:1]
            ]

    def _is_known(self, case: Case) -> bool:
        """Whether an apply would make the endpoint again and has done so often enough after the same."""
        plan = case.read[0]
        if self._applies is None or "/run/" in case.file or not re.search(r"^ +[~+-]/?[+]? endpoint", plan, re.M):
            return False
        key = (kind_of(case.file), case.mutation, *case.read[: len(LOOKS)])
        self._seen[key] += 1
        case.told = "recovered before"
        return self._seen[key] > self._applies and not case.wrong

    def _run(self, case: Case, command: Sequence[str], seconds: float) -> int | None:
        """The exit status; what is wrong with how it ended stands in the case."""
        name = " ".join(command)
        try:
            status, out, err = warm.run(OCTOFORM, command, self.project.folder, self.project.environment(), seconds)
        except subprocess.TimeoutExpired:
            case.wrong.append(f"{name}: not done after {seconds:g} s")
            case.read.append("")
            return None
        text = out + err
        case.read.append(re.sub(r"\d+", "0", text))
        if "Traceback" in (err if command == ("logs",) else text):
            last = [line for line in text.splitlines() if line.strip()][-1]
            where = [line.strip() for line in text.splitlines() if line.strip().startswith("File ")][-1:]
            case.wrong.append(f"{name}: {last[:160]} {' '.join(where)[-120:]}")
        elif name not in _QUOTES and (foreign := foreign_lines(text)):
            case.wrong.append(f"{name}: not in words of octoform: {foreign[0].strip()[:240]}")
        elif status not in (0, 2) and not text.strip():
            case.wrong.append(f"{name}: ends with {status} and says nothing")
        if command in (APPLY, ("restart",)):
            if status == 0:
                case.told = "recovered"
                return status
            lines = [line.strip() for line in err.splitlines() if line.strip()]
            case.told = next((line for line in lines if "error[" in line), *lines[:1] or [""])[:160]
        return status

    def put_back(self, inside: str) -> None:
        """One file as it was kept."""
        path = self.project.folder / inside
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        shutil.copy2(self._kept / inside, path)

    def restore(self) -> None:
        """Everything as it was kept, and no process of the endpoint but a new one."""
        self.project.run("stop")
        for top in (self.project.state, self.project.local):
            for path in sorted(top.rglob("*"), reverse=True):
                inside = path.relative_to(self.project.folder)
                if _SKIPPED.search(inside.as_posix()) or _GROWS.search(inside.as_posix()):
                    continue
                if not path.is_symlink() and path.is_dir():
                    if (self._kept / inside).is_file():
                        shutil.rmtree(path)
                else:
                    path.unlink()
        for path in self._kept.rglob("*"):
            if path.is_file():
                inside = path.relative_to(self._kept)
                (self.project.folder / inside).parent.mkdir(parents=True, exist_ok=True)
                self.put_back(inside.as_posix())
        if self._start() != 0:
            # An apply that was ended for its time leaves an environment half made, and its mark was put back.
            for mark in (self.project.local / "environments").glob(f"*/{MARKER}"):
                mark.unlink()
            self.project.run(*APPLY, status=0)

    def _start(self) -> int:
        environ = self.project.environment()
        return warm.run(OCTOFORM, ("start",), self.project.folder, environ, self._apply_seconds)[0]


def spoilt(subject: Subject, mutations: int, seed: int, only: Sequence[str], share: tuple[int, int]) -> Iterator[Case]:
    """Each kind of file so many times, in turns, so that a run that is cut off has seen every kind."""
    kinds = {name: files for name, files in subject.kinds().items() if not only or any(word in name for word in only)}
    for number in range(mutations):
        for at, (name, files) in enumerate(kinds.items()):
            if (at + number) % share[1] == share[0] - 1:
                yield subject.spoil(random.Random(f"{seed}:{name}:{number}").choice(files), number, seed)


def campaign(folder: Path, given: argparse.Namespace) -> list[Case]:
    """Damage the files of a deployment with a past; each case is printed as it is done."""
    from campaign.lived import lived
    from campaign.making import made

    part, parts = map(int, given.share.split("/"))
    # By a link: the loaded command line of the tests then keeps a process that has loaded what the endpoint needs.
    environments = folder / "environments"
    environments.mkdir(mode=0o700)
    bench = made("intranet", folder, environments, PORT + part)
    try:
        lived(bench)
        subject = Subject(bench.project, given.seconds, applies=given.applies)
        try:
            cases = []
            for case in spoilt(subject, given.mutations, given.seed, given.only, (part, parts)):
                cases.append(case)
                print(f"{case.number} {case.mutation:8} {case.file}: {'; '.join(case.wrong) or case.told}", flush=True)
            return cases
        finally:
            subject.close()
    finally:
        bench.close()


def shared(given: argparse.Namespace) -> int:
    """The campaign in so many processes, each with a deployment of its own; how many of them found something wrong."""

    def run(part: int) -> tuple[int, list[str]]:
        options = [f"--{name}={getattr(given, name)}" for name in ("mutations", "seed", "seconds", "applies")]
        command = [sys.executable, "-m", "campaign.mutations", *options, f"--share={part}/{given.workers}"]
        with subprocess.Popen([*command, "--only", *given.only], stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None
            lines = []
            for line in process.stdout:
                lines.append(line)
                print(line, end="", flush=True)
        return process.returncode, lines

    with concurrent.futures.ThreadPoolExecutor(given.workers) as pool:
        done = list(pool.map(run, range(1, given.workers + 1)))
    counts: Counter[str] = Counter()
    for _, lines in done:
        for count, word in re.findall(r"(\d+) (mutations|recovered|told|wrong)", lines[-1] if lines else ""):
            counts[word] += int(count)
    print("all: " + ", ".join(f"{count} {word}" for word, count in counts.items()))
    return 1 if any(status for status, _ in done) else 0


def main() -> int:
    """0 when nothing went wrong."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that the bench is closed
    parser = argparse.ArgumentParser()
    parser.add_argument("--mutations", type=int, default=200, help="of each kind of file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=SECONDS, help="what a command that looks may take")
    parser.add_argument("--applies", type=int, default=APPLIES, help="that make the endpoint again after the same")
    parser.add_argument("--workers", type=int, default=1, help="deployments that are damaged at the same time")
    parser.add_argument("--share", default="1/1", help="which part of the mutations: 2/3 takes the second of three")
    parser.add_argument("--only", nargs="*", default=[], help="kinds of files with one of these words in their names")
    given = parser.parse_args()
    if given.workers > 1:
        return shared(given)
    with tempfile.TemporaryDirectory(prefix="octoform-mutations-") as place:
        cases = campaign(Path(place), given)
    wrong = [case for case in cases if case.wrong]
    recovered = sum(case.told.startswith("recovered") for case in cases)
    print(f"{len(cases)} mutations: {recovered} recovered, {len(cases) - recovered} told, {len(wrong)} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
