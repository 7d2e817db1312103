"""The fault campaign: every case several times on live processes, in turns, and a table of what came of it.

``python -m campaign.run [--times N] [--only WORDS] [--out FILE]`` with ``tests`` and ``tests/support`` on the path.
"""

import argparse
import json
import signal
import sys
import tempfile
import traceback
from collections.abc import Sequence
from pathlib import Path

from campaign import (
    cases_agents,
    cases_devices,
    cases_discovery,
    cases_files,
    cases_machine,
    cases_process,
    cases_room,
    cases_tools,
)
from campaign.bench import Bench
from campaign.injecting import injected
from campaign.making import made
from campaign.model import Case, Result
from campaign.table import into, table, totals

STORY = ("id", "kind", "target", "summary", "outcome", "closed", "tries", "hint")
FRESH = ("builtin",)
"""Benches that a fault leaves as other ones, for all that they are well: taking the hardware away is one more."""
CASES: tuple[Case, ...] = (
    *cases_process.CASES,
    *cases_files.CASES,
    *cases_devices.CASES,
    *cases_room.CASES,
    *cases_machine.CASES,
    *cases_tools.CASES,
    *cases_agents.CASES,
    *cases_discovery.CASES,
)


def chosen(words: Sequence[str]) -> list[Case]:
    """The cases whose names or benches have one of these words in them; all for none."""
    return [case for case in CASES if not words or any(word in case.name or word == case.bench for word in words)]


def campaign(cases: Sequence[Case], times: int, folder: Path, out: Path | None = None) -> list[Result]:
    """Everything, bench by bench; within one in turns, so that the same fault does not follow on itself.

    ``out`` has what came of it after each injection, so that a run that is cut off is not lost.
    """
    results: list[Result] = []
    for kind in dict.fromkeys(case.bench for case in cases):
        benches = Benches(kind, folder)
        try:
            for turn in range(times):
                for case in [each for each in cases if each.bench == kind]:
                    results.append(one(case, benches))
                    print(said(turn, case, results[-1]), flush=True)
                    if out is not None:
                        out.write_text(json.dumps([each.__dict__ for each in results], indent=1))
        finally:
            benches.drop()
    return results


class Benches:
    """A bench of one kind, made anew after a case that did not end as it should have."""

    def __init__(self, kind: str, folder: Path) -> None:
        self._kind, self._folder, self._count = kind, folder, 0
        self.bench: Bench | None = None

    def get(self) -> Bench:
        """The bench, as the last case left it."""
        if self.bench is None:
            self._count += 1
            place = self._folder / f"{self._kind}{self._count}"
            place.mkdir()
            self.bench = made(self._kind, place)
        return self.bench

    def drop(self) -> None:
        """End it; the next case has a fresh one."""
        bench, self.bench = self.bench, None
        if bench is not None:
            bench.close()


def one(case: Case, benches: Benches) -> Result:
    """An injection; what goes wrong in the campaign itself counts against the case."""
    try:
        result = injected(case, benches.get())
    except Exception as problem:  # noqa: BLE001 - one broken case must not hide the others
        traceback.print_exc()
        result = Result(case.name, missed=[f"{type(problem).__name__}: {problem}"[:300]])
    failed = bool(result.missed or result.wrong)
    if failed and benches.bench is not None:
        print(story(benches.bench), file=sys.stderr, flush=True)
    if failed or case.spoils or case.bench in FRESH:
        benches.drop()
    return result


def said(turn: int, case: Case, result: Result) -> str:
    """A progress line."""
    times = " ".join("-" if each is None else f"{each:.2f}" for each in (result.detected, result.repaired))
    words = "; ".join([*result.missed, *result.wrong, *result.slow]) or "ok"
    return f"{turn + 1} {case.name}: {times} {words} {result.repairs or ''}"


def story(bench: Bench) -> str:
    """The last incidents and the output of the daemon and the endpoint, to find the reason."""
    last = [json.dumps({name: each[name] for name in STORY}) for each in list(bench.episodes().values())[-4:]]
    log = bench.layout.server_log
    printed = log.read_bytes()[-1500:].decode(errors="replace") if log.exists() else ""
    return "\n".join(["-- episodes", *last, "-- daemon", bench.said()[-1500:], "-- endpoint", printed, "--"])


def main() -> int:
    """0 when every target was met."""
    signal.signal(signal.SIGTERM, lambda number, frame: sys.exit(128 + number))  # so that the benches are closed
    parser = argparse.ArgumentParser()
    parser.add_argument("--times", type=int, default=5)
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--share", default="1/1", help="which part of the cases: 2/3 takes the second of three")
    parser.add_argument("--out", type=Path)
    parser.add_argument("--told", type=Path, nargs="+", help="inject nothing: the table of what earlier runs wrote")
    parser.add_argument("--into", type=Path, help="the page that gets the table")
    given = parser.parse_args()
    if given.told:
        lines = [Result(**each) for path in given.told for each in json.loads(path.read_text())]
        return shown(lines, given.into)
    part, parts = map(int, given.share.split("/"))
    cases = chosen(given.only)[part - 1 :: parts]
    with tempfile.TemporaryDirectory(prefix="octoform-faults-") as folder:
        results = campaign(cases, given.times, Path(folder), given.out)
    return shown(results, given.into)


def shown(results: Sequence[Result], page: Path | None) -> int:
    """Print the table, and write it into a page; 0 when every target was met."""
    cases = [case for case in CASES if any(each.case == case.name for each in results)]
    text = f"{table(cases, results)}\n\n{totals(cases, results)}"
    print(text)
    if page is not None:
        into(page, text)
    return 1 if any(each.missed or each.wrong or each.slow or each.survivors for each in results) else 0


if __name__ == "__main__":
    sys.exit(main())
