"""One recorded host through the real product: a fresh folder with a manifest, `octoform apply`, the artifacts.

Nothing of octoform is imported here: what is measured is the program that a person runs, as its own process, and what
it left in the folder. CPU seconds are those of the program and all processes it waited for.
"""

import json
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recordings.leaking import leaks, secrets_of_tree

ROOT = Path(__file__).resolve().parents[2]
PROGRAM = Path(sys.executable).with_name("octoform")
STAGES = ("probe", "identify", "interface")
HOST = "bench"
SECONDS = 180
# Entries of these names are recordings of one device or one board; all others are of a whole host.
_OF_ONE_DEVICE = frozenset(("dev", "fwupd", "hwmon", "iio", "serial", "umock", "ups"))
# Chassis types of the firmware's tables: portable, laptop, notebook, sub-notebook, tablet, convertible, detachable.
_PORTABLE = frozenset(("8", "9", "10", "14", "30", "31", "32"))
_SUMMARY = re.compile(r"^error\[([A-Z0-9-]+)\]: (.*)$", re.M)


@dataclass
class Onboarded:
    """What became of one host; ``problems`` is empty when it was onboarded. CPU seconds by step.

    ``funnel`` counts the devices that PROBE saw, that IDENTIFY annotated, and that a tool serves.
    """

    name: str
    artifacts: dict[str, Any] = field(default_factory=dict)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cpu: dict[str, float] = field(default_factory=dict)
    server_lines: int | None = None
    funnel: tuple[int, int, int] = (0, 0, 0)
    laptop: bool = False


@dataclass(frozen=True)
class Ended:
    """How a process ended; ``text`` is all that it wrote."""

    status: int | None
    text: str
    cpu: float


def is_whole_host(name: str) -> bool:
    """True for a recording of a whole host, False for one of a single device."""
    return name.partition("-")[0] not in _OF_ONE_DEVICE


def onboard(name: str, tree: Path, project: Path, until: str = STAGES[-1]) -> Onboarded:
    """Apply in the new folder ``project``, which then holds nothing but a manifest."""
    host = Onboarded(name)
    project.mkdir()
    (project / "octopus.yaml").write_text(f"version: 1\nhost: {HOST}\n", encoding="utf-8")
    ended = _apply(project, tree, until)
    host.cpu["onboarding"] = ended.cpu
    host.problems += _problems(project, ended)
    for stage in STAGES[: STAGES.index(until) + 1]:
        path = project / "state" / HOST / stage / "output.json"
        try:
            host.artifacts[stage] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as problem:
            host.problems.append(f"no readable {stage} artifact: {type(problem).__name__}")
    host.problems += [f"leaked: {leak}" for leak in leaks(project / "state" / HOST, secrets_of_tree(tree))]
    host.funnel, host.laptop = _funnel(host.artifacts), is_laptop(tree)
    if not host.problems:
        _probe_again(host, project, tree)
    return host


def is_laptop(tree: Path) -> bool:
    """True for the tree of a portable computer: its firmware's chassis type, or a lid switch beside a battery."""
    try:
        chassis = (tree / "sys/class/dmi/id/chassis_type").read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError):
        chassis = ""
    firmware = tree / "sys/bus/acpi/devices"
    return chassis in _PORTABLE or all(any(firmware.glob(f"{part}:*")) for part in ("PNP0C0A", "PNP0C0D"))


def _funnel(artifacts: Mapping[str, Any]) -> tuple[int, int, int]:
    """How many devices PROBE saw, how many of them IDENTIFY annotated, how many of those have a tool."""
    seen, annotated = (artifacts.get(stage, {}).get("devices", ()) for stage in ("probe", "identify"))
    served = {device for tool in artifacts.get("interface", {}).get("tools", ()) for device in tool["devices"]}
    return len(seen), len(annotated), len(served)


def serve(host: Onboarded, tree: Path, project: Path, environments: Path) -> None:
    """Go on to SERVE, whose gate imports the server where it will be served.

    The hosts share their serving environments: each is bound to its packages alone, and building the same one for
    every host would measure the package tool.
    """
    (project / ".octoform" / HOST / "environments").symlink_to(environments)
    ended = _apply(project, tree, "serve")
    host.cpu["serve"] = ended.cpu
    host.problems += [f"SERVE: {problem}" for problem in _problems(project, ended)]
    server = project / "state" / HOST / "serve" / "server.py"
    if server.is_file():
        host.server_lines = len(server.read_text(encoding="utf-8").splitlines())
    elif ended.status == 0:
        host.problems.append("SERVE: no server.py")


def show_ids(tree: Path, ids: Mapping[str, Path], scratch: Path) -> Path:
    """A root that shows the tree and, beside it, the id databases; the tree itself is not touched."""
    if not ids or (tree / "usr").exists():
        return tree
    root = scratch / "root"
    folder = root / "usr/share/misc"
    folder.mkdir(parents=True)
    for entry in tree.iterdir():
        (root / entry.name).symlink_to(entry.resolve())
    for name, path in ids.items():
        shutil.copyfile(path, folder / name)
    return root


def run(command: list[str], tree: Path, folder: Path) -> Ended:
    """Run a process with the tree as its system root; ``status`` is None when it did not end in time."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("OCTOFORM_")}
    environment["OCTOFORM_SYSROOT"] = str(tree)
    before = _cpu_of_children()
    try:
        ended = subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False
        )
    except subprocess.TimeoutExpired:
        return Ended(None, f"not ended after {SECONDS} s", _cpu_of_children() - before)
    return Ended(ended.returncode, ended.stdout + ended.stderr, _cpu_of_children() - before)


def _apply(project: Path, tree: Path, target: str) -> Ended:
    return run([str(PROGRAM), "apply", "-auto-approve", "-target", target], tree, project)


def _problems(project: Path, ended: Ended) -> list[str]:
    """Why a run failed, in one line for each error."""
    if ended.status == 0:
        return []
    errors = [f"{code}: {summary}" for code, summary in dict.fromkeys(_SUMMARY.findall(ended.text))]
    if not errors:
        errors = [f"exit status {ended.status}: {(ended.text.strip().splitlines() or ['no word'])[-1]}"]
    logs = sorted((project / ".octoform" / HOST / "attempts").glob("*/agent.log"))
    lines = logs[-1].read_text(encoding="utf-8", errors="replace").strip().splitlines() if logs else []
    if lines and any(error.startswith("APPLY-AGENT-FAILED") for error in errors):
        errors.append(f"the agent said: {lines[-1]}")
    return errors


def _probe_again(host: Onboarded, project: Path, tree: Path) -> None:
    """PROBE's attempt once more, alone: what it costs, and that a host which did not change looks the same."""
    attempt = next((project / ".octoform" / HOST / "attempts").glob("*-probe-1"))
    task = json.loads((attempt / "task.json").read_text(encoding="utf-8"))
    first = json.loads((attempt / "output.json").read_text(encoding="utf-8"))
    task["output"] = str(attempt / "again.json")
    again = attempt / "again-task.json"
    again.write_text(json.dumps(task), encoding="utf-8")
    began = time.monotonic()
    ended = run([sys.executable, "-m", "octoform.builtin", str(again)], tree, attempt)
    host.cpu["probe"] = ended.cpu
    if ended.status != 0:
        host.problems.append(f"PROBE, run again, failed after {time.monotonic() - began:.1f} s: {ended.text.strip()}")
        return
    second = json.loads((attempt / "again.json").read_text(encoding="utf-8"))
    if first["devices"] != second["devices"]:
        host.problems.append("PROBE, run again on the same host, lists other devices")


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
