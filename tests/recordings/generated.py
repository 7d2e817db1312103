"""Score the embedded agent over generated hosts: ``python -m recordings.generated [--devices 10000] [--seed 1]``.

Prints how many devices of how many hosts were made, and each invariant that did not hold, with the number of one host
where it did not: ``--host NUMBER`` makes that one again. Exit status 1 if any did not hold.
"""

import argparse
import sys
import tempfile
import time
from collections import Counter
from multiprocessing import Pool
from pathlib import Path

from generated_hosts import generate, ids, wrong

OF_A_HOST = 25


def main() -> int:
    """Make, judge and print; the exit status."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--devices", type=int, default=10_000)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--host", type=int, help="the number of one host, in place of those of a seed")
    given = arguments.parse_args()
    began = time.monotonic()
    hosts = range(given.seed * 100_000, given.seed * 100_000 + -(-given.devices // OF_A_HOST))
    hosts = hosts if given.host is None else range(given.host, given.host + 1)
    with Pool() as pool:
        found = list(zip(hosts, pool.imap(judged, hosts, chunksize=8), strict=True))
    lines = {line: host for host, told in reversed(found) for line in told}
    times = Counter(line for _, told in found for line in told)
    for line, number in times.most_common(40):
        print(f"  {number} x {line} (host {lines[line]})")
    print(
        f"{len(hosts) * OF_A_HOST} generated devices of {len(hosts)} hosts: {times.total()} not as they were made; "
        f"{time.monotonic() - began:.0f} s"
    )
    return 1 if times else 0


def judged(seed: int) -> list[str]:
    """What is wrong about one host, and about the same host plugged together in another order."""
    with tempfile.TemporaryDirectory(prefix="octoform-generated-") as name:
        made = generate(Path(name, "host"), seed, OF_A_HOST)
        found = wrong(Path(name, "host"), made)
        generate(Path(name, "other"), seed, OF_A_HOST, order=1)
        changed = ids(Path(name, "host")) ^ ids(Path(name, "other"))
        return [*found, *([f"ids change with the order: {sorted(changed)[:4]}"] if changed else [])]


if __name__ == "__main__":
    sys.exit(main())
