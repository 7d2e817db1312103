"""Files of a host that were spoilt: every command ends in time, in words, and apply puts right what it can.

A small sample of what `make faults` does to all of them (tests/campaign/mutations.py).
"""

import json
import os
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from campaign.mutations import Case, Subject, bare_tracebacks
from campaign.spoiling import MUTATIONS
from projects import Project

pytestmark = pytest.mark.dear
HERE = ".octoform/bench"
INSTANCES = f"{HERE}/instances.json"
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


def deep(path: Path) -> None:
    """A value of 900 levels where there was another one."""
    document = json.loads(path.read_bytes())
    document["format"] = "@@"
    path.write_text(json.dumps(document).replace('"@@"', "[" * 900 + "]" * 900))


def piped(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def linked(path: Path) -> None:
    path.unlink()
    path.symlink_to("nothing")


def foldered(path: Path) -> None:
    path.unlink()
    path.mkdir()


def written(document: dict[str, object]) -> Callable[[Path], object]:
    """Puts a document in the place of a file."""
    return lambda path: path.write_text(json.dumps(document))


WORDS = {
    "brackets": "[" * 200_000,
    "nul": '{"format": 1, "devices": {"camera": {"serial": "a\\u0000b", "port": "1-1"}}}',
    "a list of devices": '{"format": 1, "devices": ["camera"]}',
    "a number for a device": '{"format": 1, "devices": {"camera": 3}}',
    "words for nodes": '{"format": 1, "devices": {"camera": {"nodes": ["video0"]}}}',
    "a list for a serial": '{"format": 1, "devices": {"camera": {"serial": ["a"]}}}',
}


@pytest.mark.parametrize("words", WORDS)
def test_instances_of_another_form_are_told_and_written_anew(subject: Subject, words: str) -> None:
    case = subject.judge(Case(INSTANCES, words, 0), lambda path: path.write_text(WORDS[words]))
    assert (case.wrong, case.told) == ([], "recovered")


@pytest.mark.parametrize(
    ("inside", "told"),
    [
        (INSTANCES, "recovered"),
        (f"{HERE}/endpoint/manifest.json", "recovered"),
        ("state/bench/state.json", "the state file is not JSON (it is nested deeper than 128 levels)"),
    ],
)
def test_a_document_of_900_levels_ends_no_command(subject: Subject, inside: str, told: str) -> None:
    case = subject.judge(Case(inside, "deep", 0), deep)
    assert case.wrong == []
    assert case.told.endswith(told)


@pytest.mark.parametrize("value", [3, "a\0b"], ids=["a number", "a nul"])
def test_a_wrong_value_of_the_endpoints_manifest_ends_no_command_and_is_written_again(
    subject: Subject, value: object
) -> None:
    inside = f"{HERE}/endpoint/manifest.json"
    document = json.loads((subject.project.folder / inside).read_bytes())
    names = [name for name in document if name != "format"]
    for number, name in enumerate(names):
        looked = subject.look(Case(inside, name, number), written(document | {name: value}))
        assert looked.wrong == [], name
    case = subject.judge(Case(inside, "all", 0), written(document | dict.fromkeys(names, value)))
    assert (case.wrong, case.told) == ([], "recovered")


PIPED = (
    INSTANCES,
    "state/bench/deploy/output.json",
    "state/bench/probe/output.json",
    "state/bench/deploy/requirements.txt",
    "state/bench/serve/runtime/units.py",
    "state/bench/serve/server.py",
    f"{HERE}/endpoint/octoform/server/gate/gate.py",
    f"{HERE}/run/process.json",
)


@pytest.mark.parametrize("inside", PIPED)
def test_a_pipe_in_the_place_of_a_file_holds_up_nobody_who_looks(subject: Subject, inside: str) -> None:
    assert subject.look(Case(inside, "pipe", 0), piped).wrong == []


def test_pipes_in_the_places_of_all_these_files_hold_up_no_apply_which_puts_files_there(subject: Subject) -> None:
    *others, last = PIPED
    for inside in others:
        piped(subject.project.folder / inside)
    case = subject.judge(Case(last, "pipe", 0), piped)
    assert (case.wrong, case.told) == ([], "recovered")
    assert [inside for inside in PIPED if not (subject.project.folder / inside).is_file()] == []


@pytest.mark.parametrize("stands", [piped, foldered, linked], ids=lambda each: str(each.__name__))
def test_what_stands_in_the_place_of_the_log_keeps_no_endpoint_from_starting(
    subject: Subject, stands: Callable[[Path], None]
) -> None:
    subject.project.run("stop")
    stands(subject.project.folder / HERE / "log/server.log")
    subject.project.run("start", status=0)
    assert (subject.project.folder / HERE / "log/server.log").is_file()


def test_a_folder_in_the_place_of_the_record_of_the_process_is_told_as_one(subject: Subject) -> None:
    case = subject.judge(Case(f"{HERE}/run/process.json", "folder", 0), foldered)
    assert case.wrong == [] and "symbolic" not in case.told


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


OF_A_TOOL = """2026-01-01T10:00:00.000Z octoform: reference b77dc257: the tool weigh failed inside
Traceback (most recent call last):
  File "server.py", line 1, in weigh
KeyError: '13'

During handling of the above exception, another exception occurred:

Traceback (most recent call last):
  File "server.py", line 2, in weigh
ValueError: too heavy
"""
OF_THE_ENDPOINT = """Traceback (most recent call last):
  File "serve.py", line 1, in <module>
TypeError: a list
"""


def test_a_traceback_of_a_tool_is_told_from_one_of_the_endpoint() -> None:
    assert bare_tracebacks(OF_A_TOOL) == []
    assert bare_tracebacks(OF_A_TOOL + OF_THE_ENDPOINT + OF_A_TOOL) == ["TypeError: a list"]
    assert bare_tracebacks(OF_THE_ENDPOINT[:40]) == ["a traceback without an end"]


def test_what_the_endpoint_prints_behind_a_mutation_is_judged_and_nothing_older(
    subject: Subject, monkeypatch: pytest.MonkeyPatch
) -> None:
    environment = subject.project.environment()

    def printing() -> dict[str, str]:
        with (subject.project.local / "log/server.log").open("a") as log:
            log.write(OF_THE_ENDPOINT)
        return environment

    printing()
    assert subject.judge(Case(INSTANCES, "nothing", 0), lambda path: None).wrong == []
    monkeypatch.setattr(subject.project, "environment", printing)
    case = subject.judge(Case(INSTANCES, "nothing", 0), lambda path: None)
    assert case.wrong == ["the endpoint printed: TypeError: a list"]
