"""The embedded agent onboards this machine into a fresh folder. (python bench/apply_builtin.py)

Nothing is cached but packages: one apply in another folder comes first, so that the package cache is warm, and is not
counted. The endpoint counts as answering once the DEPLOY stage is accepted: by then a real MCP client has had the list
of tools and the answer of every read tool that could be called.
"""

import statistics
import sys
from typing import Any

from measuring import Row, report, scratch
from subjects import embedded, inside

ROUNDS = 3
WALL_BOUND, OWN_BOUND = 6.0, 1.2
PHASES = {
    "agent": "the embedded agent, five stages",
    "environment": "locking and building the environment",
    "server": "loading FastMCP, the import check, and the client that calls the tools",
}


def fresh() -> dict[str, Any]:
    """One apply in a folder that holds nothing but a manifest."""
    with scratch() as folder:
        return inside(embedded(folder), "apply", "-auto-approve")


def summary(found: dict[str, Any]) -> str:
    """What the run made."""
    result = found["events"][-1]["result"]
    funnel, endpoint = result["funnel"], result["endpoint"]
    return f"{funnel['seen']} devices seen, {funnel['tools']} tools; {endpoint['answered']}"


def main() -> int:
    """Measure, print, and say whether the bounds hold."""
    fresh()
    found = [fresh() for _ in range(ROUNDS)]

    def middle(values: list[float]) -> float:
        return statistics.median(values)

    own = Row("octoform's own share", middle([item["own"] + item["supervisors"] for item in found]), bound=OWN_BOUND)
    rows = [
        Row(
            "until the endpoint has answered", middle([item["done"]["deploy"] for item in found]), "s wall", WALL_BOUND
        ),
        Row("the whole apply", middle([item["wall"] for item in found]), "s wall"),
        own,
    ]
    for phase, title in PHASES.items():
        rows.append(Row(title, middle([item["phases"][phase] for item in found]), note="not in the share"))
    return report(f"apply_builtin: this machine, fresh folders, median of {ROUNDS}", rows, own, [summary(found[-1])])


if __name__ == "__main__":
    sys.exit(main())
