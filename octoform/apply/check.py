"""``check``: a program in an attempt's folder that holds the output against its contract before the agent ends.

It only asks. Whoever supervises the attempt judges, with the code that will judge the output in the end, and writes
what it found beside the program; so neither a contract nor another artifact nor a secret is within the agent's reach.
What only running an output can show (a server's tools, a set of packages) is not looked at.
"""

import re
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Self

from octoform.base import files

PROGRAM, ASKED, SAID = "check", "check.asked", "check.said"
MOST = 30
"""How often an attempt may ask: enough to mend one thing after the other, and no way to try every value."""
PAUSE_SECONDS = 0.1
_WAIT_TENTHS = 600
_KEY = re.compile(rb"[0-9a-zA-Z.-]{1,80}")
_SCRIPT = f"""#!/bin/sh
# Holds the output against its contract, as it will be held when you have ended. Status 0: it would be accepted.
cd "$(dirname "$0")" || exit 2
key="$$-$(date +%s.%N)"
echo "$key" > {ASKED}.new && mv {ASKED}.new {ASKED} || exit 2
tenths=0
while [ "$(head -n 1 {SAID} 2>/dev/null)" != "$key" ]; do
    tenths=$((tenths + 1))
    [ "$tenths" -gt {_WAIT_TENTHS} ] && echo "nobody has answered; end when you are done" && exit 2
    sleep 0.1
done
tail -n +3 {SAID}
[ "$(sed -n 2p {SAID})" = accepted ]
"""


class Checks:
    """Answers the program of one attempt while the block lasts; ``count`` is how often it has.

    ``judge`` gives the findings on the output as it is now, as text; empty when it would be accepted.
    """

    def __init__(self, folder: Path, judge: Callable[[], str]) -> None:
        self.count = 0
        self._folder, self._judge = folder, judge
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="check", daemon=True)

    def __enter__(self) -> Self:
        """OSError when the program cannot be written."""
        files.replace(self._folder / PROGRAM, _SCRIPT.encode(), 0o755, synced=False)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._over.wait(PAUSE_SECONDS):
            # A folder that the agent has made away with, or a full disk: it goes without an answer, and its end tells.
            with suppress(OSError):
                key = files.head(self._folder / ASKED, 100).strip()
                (self._folder / ASKED).unlink()
                if _KEY.fullmatch(key):
                    files.replace(self._folder / SAID, key + b"\n" + self._answer().encode(), 0o644, synced=False)

    def _answer(self) -> str:
        if self.count == MOST:
            return f"refused\nthis was asked {MOST} times; no more is judged before you end\n"
        self.count += 1
        found = self._judge()
        if found:
            return f"refused\nit would be refused ({MOST - self.count} more checks):\n{found}\n"
        return "accepted\nit would be accepted, as far as that shows without running it\n"
