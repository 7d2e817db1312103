"""What is committed of a host, and what a model is sent, names no serial number, address, user or name of it.

What is secret is read from the planted tree by other code than octoform's (tests/recordings/leaking.py), which also
judges every recording of `make recordings`; one whole state is searched by `git grep`, as a person would.
"""

import os
import subprocess
from pathlib import Path

import embedded
import pytest
from hosts.plant import NAMES, plant
from projects import Project
from recordings.leaking import SHORTEST, leaks, secrets_of_tree

from octoform.apply.stage import artifact_writer
from octoform.contracts import host_identity as instance


@pytest.mark.parametrize("name", NAMES)
def test_no_artifact_of_an_invented_host_names_it(name: str, tmp_path: Path) -> None:
    root = plant(name, tmp_path / "root")
    embedded.write_state(tmp_path / "state", root)
    assert leaks(tmp_path / "state", secrets_of_tree(root)) == []


def test_the_search_finds_what_the_trees_hold(tmp_path: Path) -> None:
    laptop = secrets_of_tree(plant("laptop", tmp_path / "laptop"))
    assert {"mc-invented-77", "ko-200417", "rnv-0001733", "02:00:5e:10:00:aa"} <= laptop
    assert "0000:00:14.0" not in laptop
    bench = secrets_of_tree(plant("bench", tmp_path / "bench"))
    assert {"hw-12-0042", "4055-0a-0b-0c-0d"} <= bench
    state = tmp_path / "state"
    state.mkdir()
    (state / "output.json").write_text('{"name": "Stepper HW\\u002d12-0042", "node": "enx02005E1000AA"}')
    assert leaks(state, bench) == ["output.json: hw-12-0042"]
    assert leaks(state, laptop) == ["output.json: 02:00:5e:10:00:aa"]
    assert leaks(state, {"200417"}) == []


@pytest.mark.parametrize(
    ("broken", "shown"),
    [
        ({}, set()),
        ({"hider": lambda _probe, _key: str}, {"rnv-0001733", "02:00:5e:10:00:aa", "heron-prime"}),
        ({"_whole": lambda value, _key: value}, {"heron-prime"}),
        ({"secrets_in_text": lambda _probe: []}, {"rnv-0001733", "heron-prime"}),
        (
            {"pseudonym": lambda secret, _key: secret},
            {"ko-200417", "batt-00417", "rnv-0001733", "02:00:5e:10:00:aa", "02:00:5e:10:00:01", "heron-prime"},
        ),
    ],
    ids=["whole", "texts", "host name", "what is secret", "pseudonyms"],
)
def test_the_search_finds_what_a_broken_veil_lets_through(
    broken: dict[str, object], shown: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = plant("laptop", tmp_path / "root")
    (root / "proc/sys/kernel/hostname").write_text("heron-prime\n")
    camera = root / "sys/devices/pci0000:00/0000:00:14.0/usb1/1-5/product"
    # A device may say all of it in its own words, also what is of another one.
    camera.write_text("Kestrel HD Camera beside RNV-0001733 of heron-prime, 02:00:5e:10:00:aa\n")
    for name, part in broken.items():
        monkeypatch.setattr(instance, name, part)
    embedded.write_state(tmp_path / "state", root)
    found = {line.partition(": ")[2] for line in leaks(tmp_path / "state", secrets_of_tree(root))}
    assert found == shown


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Project, Path]:
    """The laptop, onboarded in a home of its owner and committed to git; PROBE is tried twice."""
    home = tmp_path_factory.mktemp("home") / "agnes-muster77"
    root = plant("laptop", home / "laptop-root")
    project = Project(home / "project", home / "outside", harness="builtin")
    project.environ |= {"OCTOFORM_SYSROOT": str(root), "HOME": str(home), "USER": home.name}
    project.apply("-target", "interface", status=0)
    return project, root


def test_git_grep_over_a_state_finds_nothing_of_its_host(recorded: tuple[Project, Path]) -> None:
    project, root = recorded
    git(project, "init", "-q")
    git(project, "add", "-A")
    machine = {os.uname().nodename} if len(os.uname().nodename) >= SHORTEST else set()
    secrets = sorted({*secrets_of_tree(root), "agnes-muster77", *machine})
    patterns = [part for secret in secrets for part in ("-e", secret)]
    assert git(project, "grep", "--cached", "-i", "-l", "-F", *patterns) == ""
    # The search itself works: what is committed can be found.
    assert "octopus.yaml" in git(project, "grep", "--cached", "-l", "-F", "version: 1")


def test_the_artifacts_that_later_stages_read_are_those(recorded: tuple[Project, Path]) -> None:
    project, _ = recorded
    for stage in ("identify", "interface"):
        task = (project.attempts(stage)[0] / "task.json").read_text()
        assert f'"input": "{project.state}/' in task


def test_a_fresh_clone_goes_on_with_the_same_pseudonyms(recorded: tuple[Project, Path], tmp_path: Path) -> None:
    project, _ = recorded
    first = (project.state / "probe" / "output.json").read_bytes()
    key = project.local / "pseudonym.key"
    before = key.read_bytes()
    project.apply("-target", "probe", "-replace", "probe", status=0)
    again = (project.state / "probe" / "output.json").read_bytes()
    assert pseudonyms(again) == pseudonyms(first) != []
    key.unlink()
    (project.local / "instances.json").unlink()
    project.apply("-target", "probe", "-replace", "probe", status=0)
    # A machine without an id of its own, as some containers are, has nothing to make the same key of.
    same = bool(artifact_writer.machine_id())
    assert (key.read_bytes() == before) is same
    assert (pseudonyms((project.state / "probe" / "output.json").read_bytes()) == pseudonyms(first)) is same


def pseudonyms(data: bytes) -> list[bytes]:
    return [word for word in data.replace(b'"', b" ").split() if word.startswith(b"redacted-")]


def git(project: Project, *arguments: str) -> str:
    """What git prints; a search that finds nothing ends with 1."""
    ended = subprocess.run(["git", *arguments], cwd=project.folder, capture_output=True, text=True, check=False)
    assert ended.returncode in (0, 1), ended.stderr
    return ended.stdout
