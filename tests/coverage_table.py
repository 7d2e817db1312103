"""What `make coverage` prints: how much of each package the tests reach, from the JSON that coverage.py writes.

Packages come in the order of their names, those whose modules lie in folders by these folders, and below them the
modules of which the smallest part is reached.
"""

import json
import sys
from collections import defaultdict
from pathlib import PurePath
from typing import Any

WORST, SMALLEST = 20, 10
"""How many modules are named, and how many lines one needs for that."""


def main() -> None:
    """Read the report and print the tables."""
    files = {PurePath(name): file["summary"] for name, file in json.load(sys.stdin)["files"].items()}
    packages: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for path, summary in files.items():
        packages[".".join(path.parts[1:2]) if len(path.parts) > 2 else "octoform"].append(summary)
    print(f"{'package':<16}{'lines':>8}{'reached':>9}{'branches':>10}{'taken':>8}")
    for name, summaries in [*sorted(packages.items()), ("all", list(files.values()))]:
        lines, branches = (sum(each[f"num_{what}"] for each in summaries) for what in ("statements", "branches"))
        reached, taken = (sum(each[f"covered_{what}"] for each in summaries) for what in ("lines", "branches"))
        print(f"{name:<16}{lines:>8}{_share(reached, lines):>9}{branches:>10}{_share(taken, branches):>8}")
    print("\nleast reached modules")
    large = (each for each in files.items() if each[1]["num_statements"] >= SMALLEST)
    for path, summary in sorted(large, key=lambda each: each[1]["percent_covered"])[:WORST]:
        print(f"  {summary['percent_covered']:>5.1f} %  of {summary['num_statements']:>4} lines  {path}")


def _share(part: int, whole: int) -> str:
    return f"{100 * part / whole:.1f} %" if whole else "-"


if __name__ == "__main__":
    main()
