"""Writing a setting back: everything that a person wrote stays, or nothing is written."""

import os
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.manifest.loader import load
from octoform.manifest.setting_writer import change, comments
from octoform.manifest.starter import starter_text

FULL = """\
# top

version: 1  # format
# before the host
host: "bench"   # quoted

profiles:          # a list
    - a.md         # first
    # between
    - b.md
budget: {attempts: 2, tools: 5}   # on one line
stages:
    # the first
    probe:
        budget:
            attempts: 4   # deep
# the end
"""


def edit(path: Path, key: str, value: str | int | bool | list[str]) -> list[str]:
    return [item.code for item in change(path, key.split("."), value, {})[1]]


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name in ("a.md", "b.md", "c.md"):
        (tmp_path / name).write_text("# x\n")
    return tmp_path / "octopus.yaml"


@pytest.mark.parametrize(
    ("key", "value", "before", "after"),
    [
        ("host", "rig", 'host: "bench"   # quoted', 'host: "rig"     # quoted'),
        ("budget.attempts", 7, "{attempts: 2, tools: 5}", "{attempts: 7, tools: 5}"),
        ("stages.probe.budget.attempts", 9, "attempts: 4   # deep", "attempts: 9   # deep"),
        ("git.commit", True, "# the end\n", "# the end\ngit:\n    commit: true\n"),
        ("lifecycle.ignore", ["model"], "# the end\n", "# the end\nlifecycle:\n    ignore: [model]\n"),
    ],
)
def test_only_the_setting_changes(project: Path, key: str, value: str | int, before: str, after: str) -> None:
    project.write_text(FULL)
    assert edit(project, key, value) == []
    assert project.read_text() == FULL.replace(before, after)


def test_line_ends_and_byte_order_mark_stay(project: Path) -> None:
    project.write_bytes(b"\xef\xbb\xbf" + FULL.replace("\n", "\r\n").encode())
    assert edit(project, "budget.tools", 6) == []
    expected = FULL.replace("tools: 5", "tools: 6").replace("\n", "\r\n").encode()
    assert project.read_bytes() == b"\xef\xbb\xbf" + expected


def test_mode_and_link_stay(project: Path) -> None:
    project.write_text("version: 1\n")
    project.chmod(0o640)
    link = project.with_name("link.yaml")
    link.symlink_to(project.name)
    assert edit(link, "host", "rig") == []
    assert link.is_symlink()
    assert project.read_text() == "version: 1\nhost: rig\n"
    assert project.stat().st_mode & 0o777 == 0o640
    assert sorted(entry.name for entry in project.parent.iterdir()) == [
        "a.md",
        "b.md",
        "c.md",
        "link.yaml",
        "octopus.yaml",
    ]


def test_an_edit_of_somebody_else_at_the_same_moment_is_not_written_over(
    project: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    project.write_text("version: 1\n")
    monkeypatch.setattr(os, "fsync", lambda _: project.write_text("version: 1\nhost: bench\n"))
    assert edit(project, "answers.usb-0000-0000", "a lamp") == ["MANIFEST-UNWRITABLE"]
    assert project.read_text() == "version: 1\nhost: bench\n"
    assert sorted(path.name for path in project.parent.iterdir()) == ["a.md", "b.md", "c.md", "octopus.yaml"]


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("version: 1\n", "MANIFEST-CONTROL-CHARACTER"),
        ("version: 1\nanswers:\n  usb-0000-0000: lamp\n", "MANIFEST-NOT-EDITED"),
    ],
)
def test_bytes_that_are_no_text_are_refused(project: Path, text: str, code: str) -> None:
    project.write_text(text)
    assert edit(project, "answers.usb-0000-0000", "a lamp \udcff") == [code]
    assert project.read_text() == text


@pytest.mark.parametrize("text", ["{version: 1, host: bench}\n", "version: 1\nhost: bench\n...\n"])
def test_a_text_without_a_next_line_is_edited_too(project: Path, text: str) -> None:
    project.write_text(text)
    assert edit(project, "answers.usb-0000-0000", "a lamp") == []
    manifest, _ = load(project, {})
    assert manifest is not None and manifest.answers == {"usb-0000-0000": "a lamp"} and manifest.host == "bench"


def test_a_read_only_manifest_stays(project: Path) -> None:
    project.write_text("version: 1\n")
    project.chmod(0o444)
    assert edit(project, "host", "rig") == ["MANIFEST-UNWRITABLE"]
    assert project.read_text() == "version: 1\n"


@pytest.mark.parametrize(
    ("key", "value", "code"),
    [
        ("host", "My Bench", "MANIFEST-WRONG-VALUE"),
        ("hots", "bench", "MANIFEST-UNKNOWN-KEY"),
        ("budget.attempts", 0, "MANIFEST-WRONG-VALUE"),
        ("host.name", "x", "MANIFEST-NOT-EDITED"),
        ("profiles", ["c.md"], "MANIFEST-NOT-EDITED"),
        ("model", "sk-EXAMPLE0EXAMPLE0EXAMPLE0", "MANIFEST-SECRET"),
    ],
)
def test_what_would_do_harm_is_refused(project: Path, key: str, value: str, code: str) -> None:
    project.write_text(FULL)
    assert edit(project, key, value) == [code]
    assert project.read_text() == FULL


def test_a_manifest_with_errors_is_not_touched(project: Path) -> None:
    project.write_text("version: 1\nhots: x\n")
    assert edit(project, "host", "rig") == ["MANIFEST-UNKNOWN-KEY"]
    assert project.read_text() == "version: 1\nhots: x\n"


def test_comments_are_told_from_texts() -> None:
    text = "# a\nx: 'no # comment' # b\ny: |\n  # text\nz: a#b #c\n"
    assert comments(text) == ["# a", "# b", "#c"]


words = st.text(alphabet="abc #:'\"-é", max_size=12).map(lambda text: re.sub(r"\s+", " ", text))
notes = st.none() | words.map(lambda text: f"# {text}".rstrip())
BLOCKS = (
    ("host: bench", ("host",)),
    ("scope: local", ("scope",)),
    ("budget:\n  attempts: 2\n  tools: 9", ("budget",)),
    ("budget: {attempts: 2, tools: 9}", ("budget",)),
    ("git: {commit: false}", ("git",)),
    ("lifecycle:\n  ignore: [model]\n  prevent_destroy: true", ("lifecycle",)),
    ("stages:\n  probe:\n    budget: {attempts: 5}", ("stages",)),
)
EDITS: tuple[tuple[str, str | int | bool], ...] = (
    ("host", "rig"),
    ("budget.attempts", 7),
    ("git.commit", True),
    ("stages.serve.budget.attempts", 2),
    ("model", "a/b"),
)


@given(data=st.data())
def test_comments_and_order_survive_or_nothing_is_written(data: st.DataObject, tmp_path: Path) -> None:
    chosen = data.draw(st.permutations(BLOCKS))
    lines = [data.draw(notes) or "# first", "version: 1"]
    seen: set[str] = set()
    for block, names in chosen:
        if seen.isdisjoint(names):
            seen |= set(names)
            above, beside = data.draw(notes), data.draw(notes)
            lines += [above] if above else data.draw(st.sampled_from([[], [""]]))
            lines.append(block + (f"   {beside}" if beside else ""))
    path = tmp_path / "octopus.yaml"
    text = "\n".join(lines) + "\n"
    path.write_text(text, "utf-8")
    key, value = data.draw(st.sampled_from(EDITS))
    codes = edit(path, key, value)
    after = path.read_text("utf-8")
    if codes:
        assert after == text
        assert codes == ["MANIFEST-NOT-EDITED"] or "MANIFEST-SECRET" in codes
        return
    assert comments(after) == comments(text)
    manifest, _ = load(path, {})
    assert manifest is not None

    def keys(content: str) -> list[str]:
        return re.findall(r"^([a-z]+):", content, re.MULTILINE)

    assert [name for name in keys(after) if name in keys(text)] == keys(text)


def test_the_starter_can_be_edited(project: Path) -> None:
    project.write_text(starter_text("bench"))
    assert edit(project, "budget.attempts", 5) == []
    assert project.read_text() == starter_text("bench").replace("\n  attempts: 3     ", "\n  attempts: 5     ")
