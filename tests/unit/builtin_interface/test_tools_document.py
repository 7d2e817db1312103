"""The page about the embedded agent's tools names each of them, and no other."""

import re
from pathlib import Path

from octoform.builtin.interface import KINDS

PAGE = Path(__file__).parents[3] / "docs/tools.md"


def test_the_page_names_every_tool_and_no_other() -> None:
    table = PAGE.read_text().partition("\n## ")[0]
    rows = [line.split("|")[3] for line in table.splitlines() if line.startswith("|")]
    assert set(re.findall(r"`(\w+)`", " ".join(rows))) == set(KINDS)
