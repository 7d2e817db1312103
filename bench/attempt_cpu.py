"""What one attempt costs octoform itself: folder, prompt, supervisor, audit, gate. (python bench/attempt_cpu.py)

The same apply once with one attempt and once with many that are refused, in turns: the difference, divided by the
number of further attempts, is what an attempt costs beyond what its agent spends. The first attempt's imports and the
rest of an apply are not in it.
"""

import statistics
import sys

from measuring import Row, report, scratch
from subjects import inside, project

ROUNDS = 5
MANY = 9
BOUND = 0.080


def measured(stage: str, attempts: int) -> float:
    """CPU seconds of octoform's own share of an apply of one stage with that many attempts."""
    with scratch() as folder:
        subject = project(folder)
        subject.script = {stage: [*[{"write": "no artifact"}] * (attempts - 1), "good"]}
        subject.manifest = {"budget": f"{{attempts: {MANY}}}"}
        subject.write()
        found = inside(subject.folder, "apply", "-auto-approve", "-target", stage)
        return float(found["own"] + found["supervisors"])


def main() -> int:
    """Measure, print, and say whether the bound holds."""
    rows = []
    for stage in ("probe", "identify"):
        found = [(measured(stage, 1), measured(stage, MANY)) for _ in range(ROUNDS)]
        each = statistics.median((many - one) / (MANY - 1) for one, many in found)
        rows.append(Row(f"one more attempt at {stage}", each, bound=BOUND))
        rows.append(
            Row("  an apply with one attempt", statistics.median(one for one, _ in found), note="for comparison")
        )
    worst = max(rows[::2], key=lambda row: row.value)
    return report(f"attempt_cpu: beyond what the agent spends, median of {ROUNDS}", rows, worst)


if __name__ == "__main__":
    sys.exit(main())
