"""A manifest that is wrong is refused with its place by every command, before anything is looked at or started."""

import pytest
from projects import Project

COMMANDS = (("plan",), ("apply", "-auto-approve"), ("status",))

BAD = [
    pytest.param('version: 1\nhost: bench\nharness: {name: "command\n', "MANIFEST-SYNTAX", 3, id="F25 malformed"),
    pytest.param(
        "version: 1\nhost: bench\nharness: builtin\nbudgets: {attempts: 2}\n",
        "MANIFEST-UNKNOWN-KEY",
        4,
        id="F26 misspelt key",
    ),
    pytest.param(
        "version: 1\nhost: bench\nharness: builtin\nstages: {order: [probe]}\n",
        "MANIFEST-UNKNOWN-KEY",
        4,
        id="F26 order of stages",
    ),
]


@pytest.mark.parametrize(("text", "code", "line"), BAD)
def test_is_refused_with_line_and_column(project: Project, text: str, code: str, line: int) -> None:
    (project.folder / "octopus.yaml").write_text(text)
    before = sorted(project.folder.rglob("*"))
    for command in COMMANDS:
        done = project.run(*command, status=1)
        assert f"error[{code}]" in done.err, command
        assert f"octopus.yaml:{line}:" in done.err
        assert done.err.count("error[") == 1
    assert sorted(project.folder.rglob("*")) == before
    assert project.agent_runs() == []
