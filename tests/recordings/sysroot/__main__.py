"""`python -m recordings.sysroot ENTRY ROOT`, in the folder tests: make one tree, to look at it or to keep it."""

import json
import sys
from pathlib import Path

from recordings.sysroot.convert import convert

USAGE = "usage: python -m recordings.sysroot ENTRY ROOT"


def main(arguments: list[str]) -> int:
    """Convert and say what was read; 1 when nothing was."""
    if len(arguments) != 2 or not Path(arguments[0]).is_dir():
        print(USAGE, file=sys.stderr)
        return 2
    done = convert(Path(arguments[0]), Path(arguments[1]))
    print(json.dumps(dict(done.loaded)))
    for fault in done.faults:
        print(fault, file=sys.stderr)
    return 0 if done.loaded else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
