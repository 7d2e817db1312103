"""Score the product on a folder of recorded hosts: `python -m recordings.run DIR [-v]`, with `tests` on the path.

Each recording DIR/<name> with a truth.json is made a tree in a temporary folder and onboarded by `octoform apply` as a
process of its own, in a fresh project; recordings of whole hosts go on to SERVE, whose server is imported. Then the
artifacts are held against what people know of the devices. Nothing of a recording is kept.

A recording holds what the kernel showed, not the id databases that the host also had (usb.ids, pci.ids): this machine's
stand in for them where it has any, or those of `--ids DIR`; `--ids none` runs without, and the first line names it.
`--sample N` takes every N-th recording, always the same ones: whole hosts and single devices alike, in the order of a
digest of their names, so that neighbours (boards of one maker, parts of one host) are not taken or left out together.
The last lines are the bounds that decide (`bounds.py`): no product named wrong, `unknown` wherever truth asks for it,
nearly all onboardable devices with a tool, PROBE cheap on laptops, every host onboarded and its server imported. Exit
status 1 when one of them was missed, so that a change which makes names worse is refused.
"""

import argparse
import json
import os
import signal
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from recordings import score
from recordings.bounds import bounds, held, print_bounds, slowness
from recordings.onboarding import STAGES, Onboarded, is_whole_host, onboard, serve, show_ids
from recordings.sysroot.convert import convert
from recordings.tables import print_details, print_excluded, print_funnel, print_hosts, print_marks
from recordings.truth import Units, read_items

IDS = {
    "usb.ids": ("var/lib/usbutils", "usr/share/hwdata", "usr/share/misc"),
    "pci.ids": ("usr/share/hwdata", "usr/share/misc"),
}


@dataclass(frozen=True)
class Plan:
    """What is done with every recording; ``scratch`` is the one folder that holds all that is made on the way."""

    scratch: Path
    ids: Mapping[str, Path]
    trees: Path | None
    keep: Path | None
    until: str

    @property
    def environments(self) -> Path:
        """The serving environments, which all hosts share."""
        return self.scratch / "environments"


def main() -> int:
    """Run, mark and print; the exit status."""
    arguments = _arguments()
    # Ended from outside, it still removes its trees.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    ids = _id_files(arguments.ids)
    folders = sorted(path.parent for path in arguments.recordings.glob("*/truth.json"))
    folders = [folder for folder in folders if arguments.only in folder.name]
    if not folders:
        print(f"no recording with a truth.json in {arguments.recordings}", file=sys.stderr)
        return 1
    taken = sample(folders, arguments.sample)
    text = (
        f"{len(folders)} recordings" if taken == folders else f"a sample of {len(taken)} of {len(folders)} recordings"
    )
    print(f"{text}; id databases: {', '.join(sorted(ids)) or 'none'}", flush=True)
    began = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="octoform-recordings-") as scratch:
        plan = Plan(Path(scratch), ids, arguments.trees, arguments.keep, arguments.until)
        plan.environments.mkdir(mode=0o700)
        hosts, marks = _run_all(taken, plan)
    print_details(marks, verbose=arguments.verbose)
    for title, by_hand in (("written by hand", True), ("made by rules", False)):
        print_marks(title, [mark for mark in marks if mark.item.by_hand == by_hand], verbose=arguments.verbose)
    print_excluded(marks)
    print_hosts(hosts)
    print_funnel(hosts)
    print(f"{text}: {time.monotonic() - began:.0f} s")
    lines = bounds(hosts, marks, slowness())
    print_bounds(lines)
    return 0 if held(lines) else 1


def sample(folders: Sequence[Path], step: int) -> list[Path]:
    """Every ``step``-th recording of whole hosts, and of devices, by a digest of the name; 1 takes all of them."""
    taken = []
    for whole in (True, False):
        alike = [folder for folder in folders if is_whole_host(folder.name) == whole]
        taken += sorted(alike, key=lambda folder: sha256(folder.name.encode()).digest())[::step]
    return sorted(taken)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="score the product on recorded hosts")
    parser.add_argument("recordings", type=Path, help="folder of recordings, each with a truth.json")
    parser.add_argument("--trees", type=Path, help="folder of trees made before, one per recording")
    parser.add_argument("--ids", help="folder with usb.ids and pci.ids, or none")
    parser.add_argument("--keep", type=Path, help="keep the artifacts of every recording below this folder")
    parser.add_argument("--until", choices=(*STAGES, "serve"), default="serve", help="the last stage to run")
    parser.add_argument("--only", default="", help="only recordings whose name contains this")
    parser.add_argument("--sample", type=int, default=1, metavar="N", help="only every N-th recording, by a digest")
    parser.add_argument("-v", "--verbose", action="store_true", help="list every miss and the classes one by one")
    arguments = parser.parse_args()
    if arguments.sample < 1:
        parser.error("--sample: at least 1")
    return arguments


def _id_files(wanted: str | None) -> dict[str, Path]:
    """The id databases to show to the agent, by name."""
    if wanted == "none":
        return {}
    found = {}
    for name, folders in IDS.items():
        candidates = [Path(wanted) / name] if wanted else [Path("/") / folder / name for folder in folders]
        existing = [path.resolve() for path in candidates if path.is_file()]
        if existing:
            found[name] = existing[0]
    return found


def _run_all(folders: list[Path], plan: Plan) -> tuple[list[Onboarded], list[score.Mark]]:
    """Every recording, one for each processor at a time; the results in the order of the names."""
    hosts: dict[str, Onboarded] = {}
    marks: dict[str, list[score.Mark]] = {}
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for done in as_completed([pool.submit(run_one, folder, plan) for folder in folders]):
            host, found = done.result()
            hosts[host.name], marks[host.name] = host, found
            result = "; ".join(host.problems) or _told(host)
            print(f"[{len(hosts):3d}/{len(folders)}] {host.name:<36} {result}", flush=True)
    return [hosts[name] for name in sorted(hosts)], [mark for name in sorted(marks) for mark in marks[name]]


def run_one(folder: Path, plan: Plan) -> tuple[Onboarded, list[score.Mark]]:
    """One recording from its files to its marks, in a temporary folder of its own."""
    with tempfile.TemporaryDirectory(prefix=f"{folder.name}-", dir=plan.scratch) as name:
        scratch = Path(name)
        tree = plan.trees / folder.name if plan.trees else scratch / "tree"
        faults = () if plan.trees else convert(folder, tree).faults
        root, project = show_ids(tree, plan.ids, scratch), scratch / "project"
        host = onboard(folder.name, root, project, plan.until if plan.until in STAGES else STAGES[-1])
        host.notes += faults
        if plan.until == "serve" and is_whole_host(folder.name) and not host.problems:
            serve(host, root, project, plan.environments)
    if plan.keep:
        _keep(host, plan.keep / folder.name)
    marks = marks_of(folder, host.artifacts) if "identify" in host.artifacts else []
    # What was judged need not travel between the processes.
    host.artifacts = {stage: {} for stage in host.artifacts}
    return host, marks


def marks_of(folder: Path, artifacts: Mapping[str, Any]) -> list[score.Mark]:
    """The marks of one recording's items."""
    units = Units(artifacts["probe"])
    answers = {device["id"]: device for device in artifacts["identify"]["devices"]}
    reasons = {entry["id"]: entry["reason"] for entry in artifacts["identify"]["left_out"]}
    tools = artifacts.get("interface", {}).get("tools") or _capabilities_as_tools(answers)
    marks = []
    for item in read_items(folder):
        unit = units.find(item)
        answer = answers.get(unit["id"]) if unit else None
        if unit and answer and item.product.endswith("metadata or control node of the same camera"):
            # One unit, one annotation: the second node of a camera is not a device of its own.
            mark = score.Mark(item, score.NAMED, f"{unit['id']}: part of the camera's unit", None)
            marks.append(replace(mark, result=score.UNKNOWN_RIGHT) if mark.asked_unknown else mark)
        else:
            mark = score.mark(item, unit, answer, tools)
            # Left out because its meaning is not known: that is the right answer where the recording does not have it.
            unknown = mark.asked_unknown and unit is not None and reasons.get(unit["id"]) == "unknown_meaning"
            marks.append(replace(mark, result=score.UNKNOWN_RIGHT) if unknown else mark)
    return marks


def _capabilities_as_tools(answers: Mapping[str, Any]) -> list[dict[str, Any]]:
    """What INTERFACE would offer without a budget, where it has not run."""
    held: dict[str, list[str]] = defaultdict(list)
    for device in answers.values():
        for capability in device["capabilities"]:
            held[capability["name"]].append(device["id"])
    return [{"capability": name, "devices": devices} for name, devices in sorted(held.items())]


def _told(host: Onboarded) -> str:
    server = f", server of {host.server_lines} lines imports" if host.server_lines is not None else ""
    return f"{sum(host.cpu.values()):.1f} s{server}"


def _keep(host: Onboarded, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for stage, artifact in host.artifacts.items():
        (folder / f"{stage}.json").write_text(json.dumps(artifact, indent=1), encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
