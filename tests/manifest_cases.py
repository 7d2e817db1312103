"""Golden cases of manifests: one folder each below ``tests/cases/manifest``.

A case holds the project as a person would have it (``octopus.yaml`` and the files it names) and beside it:

* ``recipe.json`` instead of ``octopus.yaml`` where the bytes cannot or should not stand in a repository: a list of
  ``{"text": ...}`` or ``{"hex": ...}`` parts, each with ``times`` to repeat it;
* ``environ.json``: the environment variables, none by default;
* ``expected.json`` and ``expected.txt``: codes with places, and the text that a person sees.
"""

import json
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from octoform.diagnostics import Diagnostic, Span
from octoform.views.format.problems import render, summary

FOLDER = Path(__file__).parent / "cases" / "manifest"
MANIFEST = "octopus.yaml"
_BESIDE = {"recipe.json", "environ.json", "expected.json", "expected.txt"}


@dataclass(frozen=True)
class Case:
    """One folder of the golden cases."""

    folder: Path

    @property
    def name(self) -> str:
        return self.folder.name

    @property
    def environ(self) -> Mapping[str, str]:
        file = self.folder / "environ.json"
        return json.loads(file.read_text("utf-8")) if file.exists() else {}

    @property
    def expected(self) -> Mapping[str, Any]:
        found: Mapping[str, Any] = json.loads((self.folder / "expected.json").read_text("utf-8"))
        return found

    @property
    def rendered(self) -> str:
        return (self.folder / "expected.txt").read_text("utf-8")

    @property
    def is_bad(self) -> bool:
        """True when the manifest must be refused."""
        return not self.expected["loads"]

    def project_in(self, folder: Path) -> Path:
        """Lay the case out as a project; the path of its manifest."""
        for entry in self.folder.iterdir():
            if entry.is_dir():
                shutil.copytree(entry, folder / entry.name)
            elif entry.name not in _BESIDE:
                shutil.copyfile(entry, folder / entry.name)
        recipe = self.folder / "recipe.json"
        if recipe.exists():
            parts = json.loads(recipe.read_text("utf-8"))
            (folder / MANIFEST).write_bytes(b"".join(_part(part) for part in parts))
        return folder / MANIFEST

    def write(self, expected: Mapping[str, object], rendered: str) -> None:
        """Take these results as the expected ones."""
        (self.folder / "expected.json").write_text(json.dumps(expected, indent=2) + "\n", "utf-8")
        (self.folder / "expected.txt").write_text(rendered, "utf-8")


def all_cases() -> list[Case]:
    """Every case, by name."""
    return [Case(folder) for folder in sorted(FOLDER.iterdir()) if folder.is_dir()]


def _part(part: Mapping[str, str]) -> bytes:
    content = part["text"].encode("utf-8") if "text" in part else bytes.fromhex(part["hex"])
    return content * int(part.get("times", 1))


def render_all(found: Iterable[Diagnostic], *, colour: bool) -> str:
    """What a person is shown of a manifest: every diagnostic by its place, and how many there are; empty for none."""
    ordered = sorted(found, key=_place)
    return "\n\n".join([*(render(item, colour=colour) for item in ordered), summary(ordered)]) if ordered else ""


def _place(item: Diagnostic) -> tuple[str, int, int]:
    span = item.span or Span(0, 0)
    return (item.path or "", span.line, span.column)
