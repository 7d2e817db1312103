"""A second apply starts no agent. (python bench/second_apply.py [scripted|builtin ...])

Agents are counted where they leave traces: the scripted agent's own log of calls, and the folders of attempts.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from measuring import Row, report, scratch
from subjects import embedded, inside, project


def attempts(folder: Path) -> int:
    """How many attempts were made in a project folder so far."""
    return len(list((folder / ".octoform" / "bench" / "attempts").glob("0*-*")))


def twice(folder: Path, count: Callable[[], int], name: str) -> list[Row]:
    """Apply, apply again; the agents that the second one started, and what it cost."""
    inside(folder, "apply", "-auto-approve")
    before = count()
    second = inside(folder, "apply", "-auto-approve")
    if not before:
        raise SystemExit(f"{name}: the first apply started no agent, so the second proves nothing")
    return [
        Row(f"{name}: agents started by the first apply", before, ""),
        Row(f"{name}: agents started by the second", count() - before, "", bound=0),
        Row(f"{name}: the second apply", second["own"] + sum(second["phases"].values())),
    ]


def main(names: list[str]) -> int:
    """Measure, print, and say whether the bound holds."""
    rows = []
    with scratch() as folder:
        if "scripted" in names:
            made = project(folder)
            rows += twice(made.folder, lambda: len(made.agent_runs()), "scripted agent")
        if "builtin" in names:
            own = embedded(folder)
            rows += twice(own, lambda: attempts(own), "embedded agent")
    return report("second_apply: nothing to do", rows)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["scripted", "builtin"]))
