"""Score the embedded agent on a folder of recorded hosts: `python tests/recordings/run.py DIR [-v]`.

Each recording DIR/<name> with a truth.json is made a tree (or taken from `--trees`) and run through the agent's real
stages (its own process, the tree as sysroot). A recording holds what the kernel showed, not the id databases that the
host also had (usb.ids, pci.ids): this machine's stand in for them where it has any, or those of `--ids DIR`; `--ids
none` runs without, and the first line says which. Exit status 1 when anything was misidentified or a stage failed, so
that a change which makes names worse is refused.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parent))
import score
from sysroot.convert import convert
from truth import Units, read_items

ROOT = Path(__file__).resolve().parents[2]
IDS = {
    "usb.ids": ("var/lib/usbutils", "usr/share/hwdata", "usr/share/misc"),
    "pci.ids": ("usr/share/hwdata", "usr/share/misc"),
}
STAGES = ("probe", "identify", "interface")
SECONDS = 60


def main() -> int:
    """Run, mark and print; the exit status."""
    arguments = _arguments()
    ids = _id_files(arguments.ids)
    print(f"id databases: {', '.join(sorted(ids)) or 'none'}")
    marks: list[score.Mark] = []
    failures: list[str] = []
    for folder in sorted(path.parent for path in arguments.recordings.glob("*/truth.json")):
        if arguments.only and arguments.only not in folder.name:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            tree = _tree(folder, Path(scratch), arguments)
            artifacts, problem = _run_stages(_with_ids(tree, ids, Path(scratch)), folder.name, arguments)
        if problem:
            failures.append(f"{folder.name}: {problem}")
        if "identify" in artifacts:
            marks += _marks(folder, artifacts)
    _print_details(marks, verbose=arguments.verbose)
    if arguments.verbose:
        _print_unusable(marks)
    for title, by_hand in (("written by hand", True), ("made by rules", False)):
        _print_table(title, [mark for mark in marks if mark.item.by_hand == by_hand], verbose=arguments.verbose)
    for failure in failures:
        print(f"FAILED {failure}")
    return 1 if failures or any(mark.result == score.MISIDENTIFIED for mark in marks) else 0


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="score the embedded agent on recorded hosts")
    parser.add_argument("recordings", type=Path, help="folder of recordings, each with a truth.json")
    parser.add_argument("--trees", type=Path, help="folder of trees made before, one per recording")
    parser.add_argument("--ids", help="folder with usb.ids and pci.ids, or none")
    parser.add_argument("--keep", type=Path, help="keep the artifacts of every recording below this folder")
    parser.add_argument("--until", choices=STAGES, default=STAGES[-1], help="the last stage to run")
    parser.add_argument("--only", help="only recordings whose name contains this")
    parser.add_argument("-v", "--verbose", action="store_true", help="list every miss and the classes one by one")
    return parser.parse_args()


def _id_files(wanted: str | None) -> dict[str, Path]:
    """The id databases to show to the agent, by name."""
    if wanted == "none":
        return {}
    places = {name: [Path("/") / folder for folder in folders] for name, folders in IDS.items()}
    found = {}
    for name, folders in places.items():
        candidates = [Path(wanted) / name] if wanted else [folder / name for folder in folders]
        existing = [path.resolve() for path in candidates if path.is_file()]
        if existing:
            found[name] = existing[0]
    return found


def _tree(folder: Path, scratch: Path, arguments: argparse.Namespace) -> Path:
    if arguments.trees:
        return Path(arguments.trees / folder.name)
    tree = scratch / "tree"
    tree.mkdir()
    for fault in convert(folder, tree).faults:
        print(f"{folder.name}: {fault}")
    return tree


def _with_ids(tree: Path, ids: dict[str, Path], scratch: Path) -> Path:
    """A root that shows the tree and, beside it, the id databases; the tree itself is not touched."""
    if not ids or (tree / "usr").exists():
        return tree
    root = scratch / "root"
    root.mkdir()
    for entry in tree.iterdir():
        (root / entry.name).symlink_to(entry.resolve())
    folder = root / "usr/share/misc"
    folder.mkdir(parents=True)
    for name, path in ids.items():
        shutil.copyfile(path, folder / name)
    return root


def _run_stages(tree: Path, name: str, arguments: argparse.Namespace) -> tuple[dict[str, Any], str]:
    """The artifacts of the stages that there are, and what failed."""
    with tempfile.TemporaryDirectory() as scratch:
        place = arguments.keep / name if arguments.keep else Path(scratch)
        place.mkdir(parents=True, exist_ok=True)
        artifacts: dict[str, Any] = {}
        previous: Path | None = None
        for stage in STAGES[: STAGES.index(arguments.until) + 1]:
            output = place / f"{stage}.json"
            problem = _run_stage(stage, previous, output, tree)
            if problem:
                return artifacts, f"{stage}: {problem}"
            artifacts[stage] = json.loads(output.read_text(encoding="utf-8"))
            previous = output
        return artifacts, ""


def _run_stage(stage: str, previous: Path | None, output: Path, tree: Path) -> str:
    task = output.with_name(f"{stage}.task.json")
    task.write_text(
        json.dumps({"format": 1, "stage": stage, "input": str(previous) if previous else None, "output": str(output)}),
        encoding="utf-8",
    )
    environment = {**os.environ, "OCTOFORM_SYSROOT": str(tree), "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "octoform.builtin", str(task)]
    try:
        ended = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=SECONDS, check=False)
    except subprocess.TimeoutExpired:
        return f"not finished after {SECONDS} s"
    return "" if ended.returncode == 0 else (ended.stderr.strip().splitlines() or ["failed without a word"])[-1]


def _marks(folder: Path, artifacts: dict[str, Any]) -> list[score.Mark]:
    units = Units(artifacts["probe"])
    answers = {device["id"]: device for device in artifacts["identify"]["devices"]}
    tools = artifacts.get("interface", {}).get("tools") or _capabilities_as_tools(answers)
    found = [(item, units.find(item)) for item in read_items(folder)]
    marks = []
    for item, unit in found:
        answer = answers.get(unit["id"]) if unit else None
        if unit and item.product.endswith("metadata or control node of the same camera"):
            # One unit, one annotation: the second node of a camera is not a device of its own.
            marks.append(score.Mark(item, score.NAMED, f"{unit['id']}: part of the camera's unit", None))
            continue
        marks.append(score.mark(item, unit, answer, tools))
    return marks


def _capabilities_as_tools(answers: dict[str, Any]) -> list[dict[str, Any]]:
    """What INTERFACE would offer without a budget, for the time before it has run."""
    held: dict[str, list[str]] = defaultdict(list)
    for device in answers.values():
        for capability in device["capabilities"]:
            held[capability["name"]].append(device["id"])
    return [{"capability": name, "devices": devices} for name, devices in sorted(held.items())]


def _print_details(marks: list[score.Mark], *, verbose: bool) -> None:
    for mark in marks:
        if mark.result == score.MISIDENTIFIED or (verbose and mark.result not in score.RIGHT):
            basis = "hand" if mark.item.by_hand else "rule"
            print(f"{mark.result.upper()} [{basis}] {mark.item.recording}: {mark.item.match}")
            print(f"    is {mark.item.product} ({mark.item.category}, {mark.item.kind}); {mark.why}")


def _print_unusable(marks: list[score.Mark]) -> None:
    for mark in marks:
        if mark.usable is False:
            print(f"NO TOOL {mark.item.recording}: {mark.item.match} ({mark.item.kind}); {mark.why}")


def _print_table(title: str, marks: list[score.Mark], *, verbose: bool) -> None:
    print(f"\nitems {title}")
    print(f"  {_line(marks)}")
    if verbose:
        by_class: dict[str, list[score.Mark]] = defaultdict(list)
        for mark in marks:
            by_class[mark.item.kind].append(mark)
        for kind, some in sorted(by_class.items()):
            print(f"  {kind:<16} {_line(some)}")


def _line(marks: list[score.Mark]) -> str:
    count = {result: sum(mark.result == result for mark in marks) for result in (*score.RIGHT, score.MISIDENTIFIED)}
    right = count[score.NAMED] + count[score.UNKNOWN_RIGHT]
    wrong = count[score.MISIDENTIFIED]
    precision = right / (right + wrong) if right + wrong else 1.0
    recall = right / len(marks) if marks else 1.0
    seen = sum(mark.result != score.NOT_SEEN for mark in marks)
    left = sum(mark.result == score.LEFT_OUT for mark in marks)
    usable = [mark.usable for mark in marks if mark.usable is not None]
    return (
        f"items {len(marks):4d}  seen {seen:4d}  named {count[score.NAMED]:4d}  "
        f"unknown as should {count[score.UNKNOWN_RIGHT]:3d}  misidentified {wrong:3d}  left out {left:3d}  "
        f"usable {sum(usable)}/{len(usable)}  precision {precision:.3f}  recall {recall:.3f}"
    )


if __name__ == "__main__":
    sys.exit(main())
