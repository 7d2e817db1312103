"""Profiles as a manifest names them: files of the project by their paths, shipped ones by name, or texts in it.

Only files inside the project's folder count, also after links are followed: profiles are part of what is kept in git,
and a path that leads elsewhere would mean something different on every machine.
"""

import os
from pathlib import Path

from octoform.base.files import opened
from octoform.diagnostics import did_you_mean
from octoform.manifest import yaml_tree
from octoform.manifest.model import ProfileSource, TypedProfile
from octoform.manifest.problem_list import ProblemList
from octoform.manifest.schema.fields import is_typed
from octoform.manifest.yaml_tree import Items, Scalar, Table
from octoform.patterns import regex

FOLDER = "profiles"
_NAME = regex(r"[a-z0-9][a-z0-9_-]{0,79}")
_WHAT = "a profile is a readable markdown file inside the project"


def check(root: Table, project: Path, report: ProblemList) -> tuple[ProfileSource, ...]:
    """The profiles in order, files by their absolute paths; what is wrong with them goes to the report."""
    node = yaml_tree.at(root, ("profiles",))
    items = node.items if isinstance(node, Items) else ()
    found = (
        _typed(item, index, report) if is_typed(item.text) else _one(item, project, report)
        for index, item in enumerate(items)
        if isinstance(item, Scalar) and isinstance(item.value, str) and not report.is_settled(("profiles", index))
    )
    return tuple(source for source in found if source is not None)


def _typed(item: Scalar, index: int, report: ProblemList) -> TypedProfile:
    """A profile as text; a block text begins on the line after its sign, a quoted one where it stands."""
    line = item.span.line + (item.last_line > item.span.line)
    text = report.lines[line - 1] if line <= len(report.lines) else ""
    return TypedProfile(item.text, f"profiles[{index}]", line, len(text) - len(text.lstrip()))


def _one(item: Scalar, project: Path, report: ProblemList) -> Path | None:
    shown = report.shown(item.text)
    if not item.text or "\0" in item.text:
        return None
    if _NAME.fullmatch(item.text) and not (project / item.text).exists():
        return _named(item, project, report)
    path = Path(os.path.normpath(project / item.text))
    if Path(item.text).is_absolute() or not path.is_relative_to(project):
        report.error(
            "MANIFEST-PROFILE-OUTSIDE",
            f"the profile `{shown}` is not inside the project",
            item.span,
            hint="copy it beside octopus.yaml and give its relative path, such as profiles/camera.md",
        )
        return None
    try:
        return _file(item, path, project, report)
    except OSError as problem:
        report.error(
            "MANIFEST-BAD-PROFILE",
            f"the profile `{shown}` cannot be read: {problem.strerror or problem}",
            item.span,
            hint=_WHAT,
        )
        return None


def _named(item: Scalar, project: Path, report: ProblemList) -> Path | None:
    """A profile by its name alone: the project's own of that name goes before the one that comes with octoform."""
    own, others = project / FOLDER / f"{item.text}.md", shipped() / f"{item.text}.md"
    if own.exists():
        return _file(item, own, project, report)
    if others.is_file():
        return others
    names = sorted({*_stems(project / FOLDER), *_stems(shipped())})
    near = did_you_mean(item.text[:80], names)
    hint = f"did you mean `{near}`?" if near else f"octoform comes with {', '.join(_stems(shipped()))}"
    report.error("MANIFEST-MISSING-PROFILE", f"there is no profile `{report.shown(item.text)}`", item.span, hint=hint)
    return None


def located(project: Path, given: str) -> Path:
    """The file that a person means on the command line: a path, or a profile's name as octopus.yaml has it."""
    path = project / given
    if path.exists() or path.suffix or path.name != given:
        return path
    named = [folder / f"{given}.md" for folder in (project / FOLDER, shipped())]
    return next((each for each in named if each.is_file()), path)


def _stems(folder: Path) -> list[str]:
    return sorted(path.stem for path in folder.glob("*.md"))


def _file(item: Scalar, path: Path, project: Path, report: ProblemList) -> Path | None:
    shown = report.shown(item.text)
    if not path.exists():
        report.error("MANIFEST-MISSING-PROFILE", f"there is no profile `{shown}`", item.span, hint=_near(path, project))
        return None
    if not path.resolve().is_relative_to(project.resolve()):
        report.error(
            "MANIFEST-PROFILE-OUTSIDE",
            f"the profile `{shown}` is a link to a place outside the project",
            item.span,
            hint="copy the file into the project",
        )
        return None
    if not path.is_file() or path.suffix != ".md":
        what = "is no file" if not path.is_file() else "is no markdown file (.md)"
        report.error("MANIFEST-BAD-PROFILE", f"the profile `{shown}` {what}", item.span, hint=_WHAT)
        return None
    with opened(path):
        return path


def shipped() -> Path:
    """The folder of the profiles that come with octoform: inside the installed package, or at the top of the source."""
    packaged = Path(__file__).parents[1] / "profiles" / "shipped"
    return packaged if packaged.is_dir() else Path(__file__).parents[2] / "profiles"


def _near(path: Path, project: Path) -> str:
    if (shipped() / path.name[:80]).is_file():
        return f"octoform comes with one of that name: write `{path.stem}` alone to use it"
    try:
        names = [entry.name for entry in path.parent.iterdir() if entry.suffix == ".md"]
    except OSError:
        names = []
    near = did_you_mean(path.name[:80], names)
    if near:
        return f"did you mean `{(path.parent / near).relative_to(project)}`?"
    return "paths are relative to the folder of octopus.yaml"
