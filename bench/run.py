"""All benchmarks, one after the other, and which bounds hold. (make bench, or python bench/run.py [NAME ...])"""

import subprocess
import sys
from pathlib import Path

NAMES = (
    *("plan_noop", "call_cost", "endpoint_process", "gate_overhead"),
    "idle_daemon",
    *("apply_scripted", "apply_builtin", "second_apply", "attempt_cpu", "prompt_bytes"),
)


def main(names: list[str]) -> int:
    """Run each in a process of its own; 1 when one of them failed."""
    unknown = [name for name in names if name not in NAMES]
    if unknown:
        print(f"there is no benchmark {unknown[0]!r}; they are {', '.join(NAMES)}", file=sys.stderr)
        return 1
    found = {}
    for name in names or NAMES:
        path = Path(__file__).with_name(f"{name}.py")
        found[name] = subprocess.run([sys.executable, str(path)], check=False).returncode
    for name, status in found.items():
        print(f"{name:<16} {'holds' if status == 0 else 'MISSED'}")
    return 1 if any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
