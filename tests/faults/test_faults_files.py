"""Files of a host that were spoilt: every command ends in time, in words, and apply puts right what it can.

A small sample of what `make faults` does to all of them (tests/campaign/mutations.py).
"""

from collections.abc import Iterator
from pathlib import Path

import pytest
from campaign.mutations import MUTATIONS, Subject
from projects import Project

pytestmark = pytest.mark.dear
HERE = ".octoform/bench"
SAMPLE = (
    f"{HERE}/endpoint/manifest.json",
    f"{HERE}/run/process.json",
    "state/bench/deploy/requirements.txt",
)
SEED = 20
LOADED_SECONDS = 30.0
"""For a command that takes a second, on a machine that passes other tests besides; a hang takes longer."""


@pytest.fixture(scope="module")
def subject(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Subject]:
    folder = tmp_path_factory.mktemp("spoilt")
    project = Project(folder / "project", folder / "outside")
    project.apply(status=0)
    made = Subject(project, LOADED_SECONDS, 2 * LOADED_SECONDS)
    yield made
    made.close()
    project.run("stop")


@pytest.mark.parametrize("inside", SAMPLE)
def test_no_spoilt_file_ends_or_holds_up_a_command(subject: Subject, inside: str) -> None:
    case = subject.spoil(inside, 0, SEED)
    assert case.wrong == [], f"{case.mutation} of {inside}"
    assert case.told not in ("", "nothing")


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda each: str(each.__name__))
def test_every_mutation_changes_what_stands_there(tmp_path: Path, mutation: object) -> None:
    import random

    path = tmp_path / "record.json"
    changed = 0
    for seed in range(8):
        path.write_text('{"format": 1, "tools": ["read"]}')
        mutation(path, path.read_bytes(), random.Random(seed))  # type: ignore[operator]
        changed += path.is_symlink() or not path.is_file() or path.read_bytes() != b'{"format": 1, "tools": ["read"]}'
        if path.is_dir():
            for each in path.iterdir():
                each.unlink()
            path.rmdir()
        else:
            path.unlink()
    assert changed >= 6
