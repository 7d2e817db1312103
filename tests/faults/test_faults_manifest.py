"""A manifest that is wrong is refused with its place by every command, before anything is looked at or started."""

from pathlib import Path

import pytest
from projects import Project

COMMANDS = (("plan",), ("apply", "-auto-approve"), ("status",))

BAD = [
    pytest.param(
        'version: 1\nhost: bench\nharness: {name: "command\n', {"MANIFEST-SYNTAX": "octopus.yaml:3:17"}, id="F25"
    ),
    pytest.param(
        "version: 1\nhost: bench\nharness: builtin\nbudgets: {attempts: 2}\nstages: {order: [probe]}\n",
        {"MANIFEST-UNKNOWN-KEY": "octopus.yaml:4:1", "stages: {order: [probe]}": "octopus.yaml:5:10"},
        id="F26",
    ),
]


@pytest.mark.parametrize(("text", "told"), BAD)
def test_is_refused_with_line_and_column(tmp_path: Path, text: str, told: dict[str, str]) -> None:
    project = Project(tmp_path / "project", tmp_path / "outside", own_environments=True)
    project.write()
    (project.folder / "octopus.yaml").write_text(text)
    before = sorted(project.folder.rglob("*"))
    for command in COMMANDS:
        done = project.run(*command, status=1)
        assert done.err.count("error[") == len(told)
        for words, place in told.items():
            assert words in done.err, command
            assert place in done.err
    assert sorted(project.folder.rglob("*")) == before
    assert project.agent_runs() == []
