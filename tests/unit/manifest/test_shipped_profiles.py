"""Profiles that come with octoform go by name; a project's own file of that name goes before them."""

from pathlib import Path

import pytest

from octoform.diagnostics import Diagnostic
from octoform.manifest.loader import load
from octoform.manifest.profile_paths import shipped


def profiles(project: Path, *names: str) -> tuple[tuple[Path, ...], list[Diagnostic]]:
    """The files that the manifest's profiles are, and what is wrong with them."""
    (project / "octopus.yaml").write_text(f"version: 1\nhost: bench\nprofiles: [{', '.join(names)}]\n")
    manifest, found = load(project / "octopus.yaml", {})
    return (manifest.profile_files if manifest is not None else ()), found


def test_a_shipped_profile_goes_by_its_name(tmp_path: Path) -> None:
    assert profiles(tmp_path, "so-arm101") == ((shipped() / "so-arm101.md",), [])


def test_the_projects_own_file_goes_before_the_shipped_one(tmp_path: Path) -> None:
    own = tmp_path / "profiles" / "so-arm101.md"
    own.parent.mkdir()
    own.write_text("---\nname: so-arm101\n---\n")
    assert profiles(tmp_path, "so-arm101") == ((own,), [])


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("so-arm-101", "did you mean `so-arm101`?"),
        ("zzz", "octoform comes with camera-rail, so-arm101"),
        ("profiles/so-arm101.md", "octoform comes with one of that name: write `so-arm101` alone to use it"),
    ],
)
def test_a_name_that_is_none_is_told_what_there_is(tmp_path: Path, name: str, hint: str) -> None:
    _, (problem,) = profiles(tmp_path, name)
    assert (problem.code, problem.hint) == ("MANIFEST-MISSING-PROFILE", hint)


def test_a_path_outside_is_refused_as_before(tmp_path: Path) -> None:
    _, (problem,) = profiles(tmp_path, "../so-arm101.md")
    assert problem.code == "MANIFEST-PROFILE-OUTSIDE"
