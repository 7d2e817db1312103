"""Profiles that come with octoform: a manifest that names one that was not copied yet says where it is."""

from pathlib import Path

from octoform.manifest.loading import load
from octoform.manifest.profile_paths import shipped


def test_a_shipped_profile_that_was_not_copied_is_told_with_its_place(tmp_path: Path) -> None:
    (tmp_path / "octopus.yaml").write_text(
        "version: 1\nhost: bench\nprofiles: [profiles/so-arm101.md, profiles/other.md]\n"
    )
    _, found = load(tmp_path / "octopus.yaml", {})
    hints = {item.summary: item.hint for item in found}
    assert hints["there is no profile `profiles/so-arm101.md`"] == (
        f"octoform comes with one of that name; copy {shipped() / 'so-arm101.md'} there"
    )
    assert "copy" not in (hints["there is no profile `profiles/other.md`"] or "")
