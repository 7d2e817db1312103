"""Benches of each kind: what is plugged in, who the agents are, and how the endpoint is reached."""

import json
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from campaign import rig
from campaign.bench import Bench
from projects import Project
from replugged import ANSWERS, Host

REPAIRER = Path(__file__).with_name("repairer.py")
DAEMON = "{calls_per_hour: 1000}"
PORT = 17777
SMALL = "700m"
"""Size of a disk with room for an environment and little more."""


def plug_in(host: Host) -> None:
    """Everything in the port in which PROBE saw it, and nothing else; what is right already is left alone."""
    devices = host.tree.root / "sys/devices/pci0000:00/0000:00:14.0/usb1"
    wanted = {"1-1": "video4linux/video0", "1-2": "ttyUSB0", "1-3": "ttyUSB1", "1-4": "hwmon/hwmon2"}
    for port in [path.name for path in devices.glob("*-*")]:
        if port not in wanted or not (devices / port / f"{port}:1.0" / wanted[port]).exists():
            host.unplug(port)
    plugs: Mapping[str, Callable[[], None]] = {
        "1-1": lambda: host.camera("1-1", 0),
        "1-2": lambda: host.board("1-2", "ttyUSB0", "left"),
        "1-3": lambda: host.board("1-3", "ttyUSB1", "right"),
        "1-4": lambda: host.sensor("1-4", 2, "21500"),
    }
    for port, plug in plugs.items():
        if not (devices / port).exists():
            plug()


def made(kind: str, folder: Path, environments: Path | None = None, port: int = PORT, *, loaded: bool = False) -> Bench:
    """A bench that is applied and watched: ``scripted``, ``intranet``, ``builtin`` or ``small``.

    ``small`` has a disk of its own (mounting it needs the rights of root). ``environments`` is a folder of serving
    environments that others have too, for who injects nothing into them.
    """
    if kind == "small":
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={SMALL}", "octoform-campaign", str(folder)], check=True)
    host = Host(folder / "root")
    plug_in(host)
    harness = "builtin" if kind == "builtin" else None
    project = Project(folder / "project", folder / "outside", script=rig.script(), harness=harness)
    project.environ["OCTOFORM_SYSROOT"] = str(host.tree.root)
    project.manifest = {"daemon": DAEMON, "policy": "{actuate: allow, timeouts: {wait_for_sensor: 2s}}"}
    if kind != "builtin":
        project.manifest["answers"] = ANSWERS
        project.outside.mkdir(parents=True)
        script = project.outside / "repairer.json"
        script.write_text(json.dumps({"watch": {"report": rig.report("healthy")}, "heal": {"exit": 1}}))
        agent = json.dumps([sys.executable, str(REPAIRER), str(script)])
        repairing = f"{{harness: {{name: command, command: {agent}, sandbox: false}}, budget: {{attempts: 2}}}}"
        project.manifest["stages"] = f"{{probe: {{harness: builtin}}, watch: {repairing}, heal: {repairing}}}"
    else:
        del project.manifest["policy"]
    if kind == "intranet":
        project.manifest |= {"scope": "intranet", "network": f"{{interface: lo, port: {port}}}"}
    if environments is not None:
        project.share_environments(environments)
    project.apply(status=0)
    project.run("start", status=0)
    bench = Bench(project, host, plug_in)
    bench.loaded = loaded
    if kind == "small":
        bench.closing = lambda: subprocess.run(["umount", "--lazy", str(folder)], check=True)
    bench.watch()
    return bench
