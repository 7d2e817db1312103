"""The key of pseudonyms: the same for a lineage on a machine, another one anywhere else."""

from pathlib import Path

import pytest

from octoform.apply.stage import artifact_writer
from octoform.apply.stage.artifact_writer import pseudonym_key
from octoform.state.layout import Layout


@pytest.fixture
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file with the id of an invented machine."""
    path = tmp_path / "machine-id"
    path.write_text("0123456789abcdef0123456789abcdef\n")
    monkeypatch.setattr(artifact_writer, "MACHINE_ID", path)
    return path


def key(folder: Path, lineage: str) -> bytes:
    layout = Layout(folder, "bench")
    layout.local.mkdir(parents=True, mode=0o700)
    return pseudonym_key(layout, lineage)


def test_a_fresh_clone_on_the_same_machine_has_the_same_key(machine: Path, tmp_path: Path) -> None:
    assert key(tmp_path / "one", "a-lineage") == key(tmp_path / "two", "a-lineage")
    assert key(tmp_path / "other", "another-lineage") != key(tmp_path / "third", "a-lineage")


@pytest.mark.parametrize("written", ["", "uninitialized\n", None])
def test_a_machine_without_an_id_draws_a_key_and_keeps_it(machine: Path, tmp_path: Path, written: str | None) -> None:
    machine.unlink() if written is None else machine.write_text(written)
    first = key(tmp_path / "one", "a-lineage")
    assert first != key(tmp_path / "two", "a-lineage")
    assert first == pseudonym_key(Layout(tmp_path / "one", "bench"), "a-lineage")
