"""The fork server of the tests' own processes: one that is not used for a minute goes on, for another test soon does.

To load what it loads takes a second of CPU, as long as ten commands. Those that commands begin for themselves are the
real ones.
"""

import runpy
from pathlib import Path

SCRIPT = Path(__file__)
IDLE_SECONDS = 180.0

if __name__ == "__main__":
    program = runpy.run_path(str(SCRIPT.parents[2] / "octoform/endpoint/scripts/fork_server.py"))
    program["serve"].__globals__["IDLE_SECONDS"] = IDLE_SECONDS
    program["main"]()
