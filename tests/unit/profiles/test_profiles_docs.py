"""What the documents show of profiles is what can be written: their examples are read as they stand."""

import re
import textwrap
from pathlib import Path

import pytest

from octoform.profiles import load_text

ROOT = Path(__file__).parents[3]
PAGES = sorted((ROOT / "octoform" / "diagnostics" / "pages").glob("PROFILE-*.md"))
_BLOCK = re.compile(r"(?:^    .*\n(?:\n(?=    ))?)+", re.MULTILINE)
_PARTS = ("limits:", "stop:", "grammar:", "rig:")
HEAD = 'name: lamp\nabout: a lamp\nevidence: {all: [{vid_pid: "0000:0000"}, {text: [Lamp]}]}\n'


def examples(path: Path) -> list[str]:
    return [textwrap.dedent(block) for block in _BLOCK.findall(path.read_text())]


@pytest.mark.parametrize("path", [ROOT / "docs" / "profiles.md", *PAGES], ids=lambda path: path.name)
def test_every_part_of_a_profile_that_is_shown_can_be_read(path: Path) -> None:
    for example in examples(path):
        if example.startswith(_PARTS):
            profile, found = load_text(f"---\n{HEAD}{example}---\nIt shines.\n", path.name)
            assert found == [] and profile is not None, example


def test_the_whole_example_and_all_parts_are_there() -> None:
    shown = examples(ROOT / "docs" / "profiles.md")
    whole = next(example for example in shown if example.startswith("---"))
    assert load_text(whole, "docs")[1] == []
    assert {part for part in _PARTS for example in shown if example.startswith(part)} == {"stop:", "grammar:", "rig:"}
