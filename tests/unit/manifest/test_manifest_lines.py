"""One answer written or taken back: its own line changes, and no other byte of the file."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from octoform.manifest import setting_writer as lines
from octoform.manifest.loader import load
from octoform.manifest.setting_writer import change, comments

BOARD = "usb-0000-0001"
KEYS = ("answers", BOARD)
TABLE = "version: 1\nanswers:\n    usb-0000-0009: lamp   # first\n    # between\n    {}\nhost: bench  # last\n"


def written(path: Path, text: str, sentence: str | None) -> tuple[bytes | None, list[str]]:
    path.write_bytes(text.encode())
    edited, found = change(path, KEYS, sentence, {})
    return path.read_bytes() if edited else None, [item.code for item in found]


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("version: 1\n", 'version: 1\nanswers:\n  usb-0000-0001: "a pump"\n'),
        ("version: 1", 'version: 1\nanswers:\n  usb-0000-0001: "a pump"\n'),
        ("version: 1\r\nhost: a\r\n", 'version: 1\r\nhost: a\r\nanswers:\r\n  usb-0000-0001: "a pump"\r\n'),
        ("\ufeffversion: 1\n", '\ufeffversion: 1\nanswers:\n  usb-0000-0001: "a pump"\n'),
        ("answers: {}\nversion: 1\n", 'answers:\n  usb-0000-0001: "a pump"\nversion: 1\n'),
        ("answers: {} # none\nversion: 1\n", 'answers:  # none\n  usb-0000-0001: "a pump"\nversion: 1\n'),
        (
            TABLE.replace("    {}\n", f"    {BOARD}: 'the old' # said\n"),
            TABLE.replace("    {}\n", f'    {BOARD}: "a pump" # said\n'),
        ),
        (
            TABLE.replace("    {}\n", f"    {BOARD}: |\n      two\n      lines\n"),
            TABLE.replace("    {}\n", f'    {BOARD}: "a pump"\n'),
        ),
        (
            TABLE.replace("    {}\n", ""),
            TABLE.replace("    # between\n    {}\n", f'    {BOARD}: "a pump"\n    # between\n'),
        ),
    ],
)
def test_one_line_changes(tmp_path: Path, before: str, after: str) -> None:
    assert written(tmp_path / "octopus.yaml", before, "a pump") == (after.encode(), [])


def test_a_table_on_one_line_is_edited_as_a_whole(tmp_path: Path) -> None:
    text = "version: 1  # of the format\nanswers: {usb-0000-0009: lamp}\n"
    content, found = written(tmp_path / "octopus.yaml", text, "a pump")
    assert found == []
    assert content == b"version: 1  # of the format\nanswers: {usb-0000-0009: lamp, usb-0000-0001: a pump}\n"


@pytest.mark.parametrize(
    ("before", "after"),
    [
        (f'version: 1\nanswers:\n  {BOARD}: "a pump"\n', "version: 1\nanswers: {}\n"),
        (
            f"version: 1\nanswers: # said\n  {BOARD}: |\n    a\n    pump\nhost: a\n",
            "version: 1\nanswers: {} # said\nhost: a\n",
        ),
        (TABLE.replace("    {}\n", f"    {BOARD}: a pump\n"), TABLE.replace("    {}\n", "")),
    ],
)
def test_one_line_goes(tmp_path: Path, before: str, after: str) -> None:
    assert written(tmp_path / "octopus.yaml", before, None) == (after.encode(), [])


def test_a_comment_on_the_line_itself_is_not_lost(tmp_path: Path) -> None:
    text = f"version: 1\nanswers:\n  {BOARD}: a pump # checked in March\n  usb-0000-0009: lamp\n"
    assert written(tmp_path / "octopus.yaml", text, None) == (None, ["MANIFEST-NOT-EDITED"])
    assert (tmp_path / "octopus.yaml").read_text() == text


@given(sentence=st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=2, max_size=60))
def test_any_sentence_comes_back_as_it_was_given(tmp_path: Path, sentence: str) -> None:
    text = TABLE.replace("    {}\n", "")
    path = tmp_path / "octopus.yaml"
    content, found = written(path, text, sentence)
    if content is None:  # no words, or what could be a secret or a reference
        assert set(found) <= {"MANIFEST-WRONG-VALUE", "MANIFEST-SECRET", "MANIFEST-ENV-NOT-ALLOWED"}
        return
    manifest, _ = load(path, {})
    assert manifest is not None
    assert manifest.answers == {"usb-0000-0009": "lamp", BOARD: sentence}
    assert comments(content.decode()) == comments(text)
    assert lines.drop(content.decode(), *KEYS) == text
