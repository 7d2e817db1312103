"""Five stages with an agent that answers at once: what octoform itself spends. (python bench/apply_scripted.py)

The own share is RUSAGE_SELF of the octoform process from the start of its interpreter, and the supervisors of the
agents. Not in it: the agents, the serving environment (uv), the import check of SERVE, the server and its client.
"""

import statistics
import sys

from measuring import Row, report, scratch
from subjects import inside, project

ROUNDS = 5
BOUND = 1.0
PHASES = {
    "agent": "the scripted agent, five times",
    "environment": "locking and building the environment",
    "server": "loading FastMCP, the import check, and the client that calls the tools",
}


def main() -> int:
    """Measure, print, and say whether the bound holds."""
    found = []
    for _ in range(ROUNDS):
        with scratch() as folder:
            found.append(inside(project(folder).folder, "apply", "-auto-approve"))
    own = [item["own"] for item in found]
    supervisors = [item["supervisors"] for item in found]
    both = Row(
        "octoform's own share",
        statistics.median(a + b for a, b in zip(own, supervisors, strict=True)),
        bound=BOUND,
        note=f"{found[0]['agents']} agent runs",
    )
    rows = [
        both,
        Row("  its process", statistics.median(own)),
        Row("  the supervisors of the agents", statistics.median(supervisors)),
    ]
    for phase, title in PHASES.items():
        rows.append(Row(title, statistics.median(item["phases"][phase] for item in found), note="not in the share"))
    return report(f"apply_scripted: five stages, fresh folders, median of {ROUNDS}", rows, both)


if __name__ == "__main__":
    sys.exit(main())
