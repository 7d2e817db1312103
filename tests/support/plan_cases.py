"""Golden cases of plans: one folder each below ``tests/cases/plan``.

A case is a project as a person would have it now (octopus.yaml, profiles/, protocol/) and beside it:

* ``case.json``: ``about`` (one sentence), ``arguments`` of ``octoform plan``, ``applied`` (true when the project was
  applied before), ``hardware`` with what the kernel announced ``before`` and announces ``now``, and ``since``: what
  happened after that apply, a list of [event, subject] (see `HAPPENINGS`);
* ``before/``: files of the project that were different when it was applied;
* ``plan.txt`` and ``plan.json``: what a person and a program must read.
"""

import json
import os
import shutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from settled import Settled, sysroot

from octoform.diagnostics import error
from octoform.state.layout import Layout
from octoform.state.store.store import StateStore

FOLDER = Path(__file__).parents[1] / "cases" / "plan"
SHIPPED = Path(__file__).parents[2] / "protocol"
HARDWARE = ["hwmon:benchtemp", "usb:v0A0Ap0001d0100dc00dsc00dp00icFFisc00ip00in00"]
_BESIDE = {"case.json", "before", "plan.json", "plan.txt", "warnings.txt"}


def _artifact(layout: Layout, name: str) -> Path:
    return layout.committed / name


def _edit(layout: Layout, _: StateStore, name: str) -> None:
    """An artifact was edited by hand."""
    path = _artifact(layout, name)
    path.write_text(path.read_text().replace("bench", "shelf"))


def _delete(layout: Layout, _: StateStore, name: str) -> None:
    """A file of an artifact was deleted."""
    _artifact(layout, name).unlink()


def _link(layout: Layout, _: StateStore, name: str) -> None:
    """An artifact was replaced by a link."""
    path = _artifact(layout, name)
    path.rename(layout.project / "moved")
    path.symlink_to(layout.project / "moved")


def _unserve(layout: Layout, _: StateStore, name: str) -> None:
    """A file of the endpoint was deleted."""
    (layout.endpoint / name).unlink()


def _lose(layout: Layout, _: StateStore, name: str) -> None:
    """A file that stays on the machine was lost, or the project was cloned to another machine."""
    (layout.local / name).unlink()


def _interrupt(_: Layout, store: StateStore, name: str) -> None:
    """A run began on a node, and its end was not recorded."""
    assert store.begin(name) == []


def _fail(_: Layout, store: StateStore, name: str) -> None:
    """A node's last run failed."""
    assert store.begin(name) == []
    assert store.failure(name, [error("APPLY-TIMEOUT", "the agent did not end")]) == []


def _taint(_: Layout, store: StateStore, name: str) -> None:
    """A person tainted a node."""
    assert store.taint(name) == []


def _forget(_: Layout, store: StateStore, name: str) -> None:
    """A person removed a node from the state."""
    assert store.remove(name) == []


HAPPENINGS: Mapping[str, Callable[[Layout, StateStore, str], None]] = {
    "edited": _edit,
    "deleted": _delete,
    "linked": _link,
    "endpoint file deleted": _unserve,
    "lost on the machine": _lose,
    "interrupted": _interrupt,
    "failed": _fail,
    "tainted": _taint,
    "forgotten": _forget,
}


@dataclass(frozen=True)
class Case:
    """One folder of the golden cases."""

    folder: Path

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def facts(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = json.loads((self.folder / "case.json").read_text("utf-8"))
        return found

    @property
    def text(self) -> str:
        return (self.folder / "plan.txt").read_text("utf-8")

    @property
    def document(self) -> Any:
        return json.loads((self.folder / "plan.json").read_text("utf-8"))

    @property
    def warnings(self) -> str:
        """What is said beside the plan; a case without the file is one without warnings."""
        path = self.folder / "warnings.txt"
        return path.read_text("utf-8") if path.exists() else ""

    def write(self, text: str, warnings: str, document: object) -> None:
        """Take these results as the expected ones."""
        if warnings:
            (self.folder / "warnings.txt").write_text(warnings, "utf-8")
        else:
            (self.folder / "warnings.txt").unlink(missing_ok=True)
        (self.folder / "plan.txt").write_text(text, "utf-8")
        (self.folder / "plan.json").write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", "utf-8")

    def lay_out(self, folder: Path) -> tuple[Path, Path]:
        """The project as it stands now, with all that happened to it, and the system root of its host."""
        project, root = folder / "project", folder / "root"
        self._files(project)
        hardware = self.facts.get("hardware", {})
        sysroot(root, hardware.get("before", HARDWARE))
        if self.facts["applied"]:
            self._apply(project, root)
        sysroot(root, hardware.get("now", HARDWARE))
        return project, root

    def _files(self, project: Path) -> None:
        for entry in self.folder.iterdir():
            if entry.is_dir() and entry.name not in _BESIDE:
                shutil.copytree(entry, project / entry.name)
            elif entry.name not in _BESIDE:
                project.mkdir(exist_ok=True)
                shutil.copyfile(entry, project / entry.name)

    def _apply(self, project: Path, root: Path) -> None:
        """Apply the project as it was, then bring its files to what they are now."""
        if (self.folder / "before").is_dir():
            shutil.copytree(self.folder / "before", project, dirs_exist_ok=True)
        settled = Settled(project, {**os.environ, "OCTOFORM_SYSROOT": str(root)})
        layout = settled.apply()
        shutil.copytree(self.folder, project, dirs_exist_ok=True, ignore=lambda *_: _BESIDE)
        store = settled.store(layout)
        for happening, subject in self.facts.get("since", []):
            HAPPENINGS[happening](layout, store, subject)


def all_cases() -> list[Case]:
    """Every case, by name."""
    return [Case(folder) for folder in sorted(FOLDER.iterdir()) if folder.is_dir()]


def comparable(lines: str) -> list[dict[str, Any]]:
    """The JSON stream without what differs from run to run or from version to version."""
    events = [json.loads(line) for line in lines.splitlines()]
    for event in events:
        del event["@timestamp"]
        if event["type"] == "version":
            event.update({"@message": "octoform (version)", "octoform": "(version)"})
        if event.get("lineage"):
            event["lineage"] = "(lineage)"
    return events
