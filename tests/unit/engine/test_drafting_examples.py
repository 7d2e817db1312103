"""The grammars that a draft shows as comments are grammars once somebody takes the comment signs away."""

import textwrap

import pytest

from octoform.engine import profiles
from octoform.profiles import load_text

HEAD = 'name: lamp\nabout: a lamp\nevidence: {all: [{vid_pid: "0000:0000"}, {text: [Lamp]}]}\n'


@pytest.mark.parametrize("shown", [profiles._LINES, profiles._REGISTERS], ids=["lines", "registers"])
def test_a_commented_grammar_can_be_read(shown: str) -> None:
    bare = "\n".join(line.removeprefix("# ") for line in shown.splitlines() if not line.startswith("# docs"))
    example = bare[bare.index("grammar:") :]
    profile, found = load_text(f"---\n{HEAD}{textwrap.dedent(example)}\n---\nIt shines.\n", "draft")
    assert found == [] and profile is not None and profile.grammar is not None
