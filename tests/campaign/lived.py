"""A deployment with a past: everything that octoform writes down in the life of a host is there to be damaged."""

import json
import os
import signal

from campaign.bench import LONG, Bench, until
from campaign.cases_tools import BROKEN, broken
from campaign.rig import SENSOR, report


def lived(bench: Bench) -> None:
    """A crash, a tool that fails and is given up, a permanent restriction, an emergency stop; then end the daemon."""
    served = bench.process()
    assert served is not None
    os.kill(served.pid, signal.SIGKILL)
    assert until(lambda: bench.process() not in (None, served) and bench.serves(), LONG), bench.said()
    retired = {"kind": "disable_unit", "target": f"device:{SENSOR}", "statement": "The sensor is worn out."}
    broken(bench, watch={"report": {**report("error", BROKEN), "declarations": [retired]}})
    assert until(lambda: any(each["outcome"] in ("frozen", "surfaced") for each in bench.open_episodes()), 5 * LONG), (
        bench.said()
    )
    while bench.undo:
        bench.undo.pop()()
    assert until(lambda: bench.call("weigh")[0] and not bench.open_episodes(), 5 * LONG), bench.said()
    run = bench.project.run
    for command in (("pause",), ("estop",), ("estop", "-clear"), ("token", "create", "second")):
        run(*command, status=0)
    waiting = [each["id"] for each in json.loads((bench.layout.daemon / "claims.json").read_bytes())["claims"]]
    for identity in waiting:
        run("confirm", identity, "-auto-approve")
    run("look", "-save")
    bench.end_daemon()
    bench.project.apply(status=0)
