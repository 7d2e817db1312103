"""Artifacts of privileged steps on disk: below ``steps/``, observed by the names of their nodes; no link followed."""

from pathlib import Path

from octoform.state.accepted import accept, file_digest, observe
from octoform.state.layout import STAGES, Layout

NODE, FILES = "step.lamp", {"output.json": b"{}\n"}


def test_a_step_lies_in_its_own_folder(tmp_path: Path) -> None:
    layout = Layout(tmp_path, "bench")
    assert set(observe(layout)) == set(STAGES)
    assert accept(layout, NODE, FILES) == []
    assert (tmp_path / "state" / "bench" / "steps" / "lamp" / "output.json").read_bytes() == b"{}\n"
    found = observe(layout)
    assert set(found) == {*STAGES, NODE}
    assert found[NODE].exists and found[NODE].digest == file_digest(layout, NODE) is not None
    assert not any(path.name.startswith(".") for path in layout.committed.rglob("*"))


def test_a_link_in_the_place_of_all_steps_is_not_followed_and_gives_way(tmp_path: Path) -> None:
    layout, elsewhere = Layout(tmp_path, "bench"), tmp_path / "elsewhere"
    assert accept(layout, NODE, FILES) == []
    layout.steps.rename(elsewhere)
    layout.steps.symlink_to(elsewhere)
    found = observe(layout)[NODE]
    assert (found.exists, found.digest, found.is_link) == (False, None, True)
    assert accept(layout, NODE, {"output.json": b"{1}\n"}) == []
    assert not layout.steps.is_symlink()
    assert (elsewhere / "lamp" / "output.json").read_bytes() == b"{}\n"
