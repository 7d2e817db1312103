"""How many bytes the prompt of each stage has, beside a reference. (python bench/prompt_bytes.py)

The prompts are those that a real apply wrote into its attempt folders: spec, schema, paths and limits of the first
attempt, on a host without profiles.
"""

import sys

from measuring import Row, report, scratch
from subjects import inside, project

REFERENCE = {"probe": 2982, "identify": 7781, "interface": 3669, "serve": 9487, "deploy": 5089}


def main() -> int:
    """Measure and print; the bound of a prompt's size is a test's business."""
    with scratch() as folder:
        subject = project(folder)
        inside(subject.folder, "apply", "-auto-approve")
        sizes = {stage: (subject.attempts(stage)[0] / "prompt.md").stat().st_size for stage in REFERENCE}
    rows = [
        Row(stage, size, "bytes", note=f"reference {REFERENCE[stage]:>6,}, {size / REFERENCE[stage]:.2f} x")
        for stage, size in sizes.items()
    ]
    total, reference = sum(sizes.values()), sum(REFERENCE.values())
    rows.append(Row("all five", total, "bytes", note=f"reference {reference:>6,}, {total / reference:.2f} x"))
    return report("prompt_bytes: first attempt of each stage", rows)


if __name__ == "__main__":
    sys.exit(main())
