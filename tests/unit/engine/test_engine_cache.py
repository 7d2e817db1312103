"""The memo saves a plan its heavy imports and is never believed when anything that it rests on has moved."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from settled import Settled, sysroot, tree

import octoform
from octoform.base.digest import of_bytes
from octoform.cli.main import main
from octoform.endpoint.published_files import CHECK
from octoform.engine.plan import memo as cache
from octoform.state.layout import Layout

SHIPPED = Path(__file__).parents[3] / "protocol"
MANIFEST = """\
version: 1
host: bench
harness: {name: command, command: [agent], env: [AGENT_TOKEN]}
profiles: [profiles/lamp.md]
"""
PROFILE = """\
---
name: lamp
about: the lamp over the bench
evidence: {text: [USB Serial]}
---

It dims in steps.
"""
HEAVY = ("pydantic", "ruamel", "jsonschema", "jinja2", "rich", "git", "fastmcp")


@dataclass(frozen=True)
class Bench:
    """A project in which nothing is left to do, and whose memo states it."""

    project: Path
    root: Path

    @property
    def layout(self) -> Layout:
        return Layout(self.project, "bench")

    @property
    def memo(self) -> Path:
        return cache.path_of(self.project)

    def hit(self) -> bool:
        return cache.recall(self.project, os.environ) is not None

    def run(self, *arguments: str) -> int:
        return main(["-chdir", str(self.project), *arguments])

    def hardware(self, *modaliases: str) -> None:
        sysroot(self.root, modaliases)


@pytest.fixture(scope="module")
def settled(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Made once; a copy of it lies beside it."""
    folder = tmp_path_factory.mktemp("settled") / "bench"
    project = folder / "project"
    shutil.copytree(SHIPPED, project / "protocol")
    (project / "profiles").mkdir()
    (project / "profiles" / "lamp.md").write_text(PROFILE)
    (project / "octopus.yaml").write_text(MANIFEST)
    made = Bench(project, folder / "root")
    made.hardware("usb:v0A0Ap0001d0100")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("OCTOFORM_SYSROOT", str(made.root))
        patch.setenv("AGENT_TOKEN", "one")
        Settled(project, os.environ).apply()
        assert made.run("apply", "-auto-approve") == 0
    shutil.copytree(folder, folder.with_name("kept"), symlinks=True)
    return made


@pytest.fixture
def bench(settled: Bench, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Bench:
    """It as it was made, whatever the test before did to it; the memo rests on paths, so it lies where it was."""
    folder = settled.project.parent
    shutil.rmtree(folder)
    shutil.copytree(folder.with_name("kept"), folder, symlinks=True)
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(settled.root))
    monkeypatch.setenv("AGENT_TOKEN", "one")
    capsys.readouterr()
    assert settled.hit()
    return settled


def add_a_byte(name: str) -> Callable[[Bench], None]:
    """The change of one file of the project by one byte, its times put back."""

    def change(bench: Bench) -> None:
        path = bench.project / name
        facts = path.stat()
        path.write_bytes(path.read_bytes() + b"\n")
        os.utime(path, ns=(facts.st_atime_ns, facts.st_mtime_ns))

    return change


def new(name: str) -> Callable[[Bench], None]:
    def change(bench: Bench) -> None:
        (bench.project / name).parent.mkdir(exist_ok=True)
        (bench.project / name).write_text("new\n")

    return change


def link_in_place(name: str) -> Callable[[Bench], None]:
    """The same bytes, behind a link."""

    def change(bench: Bench) -> None:
        path = bench.project / name
        path.rename(bench.project / "elsewhere")
        path.symlink_to(bench.project / "elsewhere")

    return change


def removed(name: str) -> Callable[[Bench], None]:
    return lambda bench: (bench.project / name).unlink()


def rewrite_seal(bench: Bench, **changes: object) -> None:
    """An edit of the memo by somebody who knows its format."""
    document = json.loads(bench.memo.read_bytes().partition(b"\n")[2]) | changes
    text = json.dumps(document).encode()
    bench.memo.write_bytes(of_bytes(text).encode() + b"\n" + text)


def edit_memo(bench: Bench) -> None:
    bench.memo.write_bytes(bench.memo.read_bytes().replace(b'"no-op"', b'"no-op" '))


def cut_memo(bench: Bench) -> None:
    bench.memo.write_bytes(bench.memo.read_bytes()[:-20])


def link_memo(bench: Bench) -> None:
    link_in_place(".octoform/compiled.json")(bench)


def no_answer(bench: Bench) -> None:
    path = bench.layout.endpoint / CHECK
    path.write_text(json.dumps({**json.loads(path.read_text()), "answered": False}))


def upgraded(bench: Bench) -> None:
    (found,) = bench.layout.environments.glob("*/lib/python*/site-packages/fastmcp-4.1.0.dist-info")
    found.rename(found.with_name("fastmcp-9.9.dist-info"))


STATE = "state/bench"
MOVED: dict[str, Callable[[Bench], object]] = {
    "manifest": add_a_byte("octopus.yaml"),
    "spec": add_a_byte("protocol/identify.md"),
    "schema": add_a_byte("protocol/schemas/probe.v1.schema.json"),
    "profile": add_a_byte("profiles/lamp.md"),
    "artifact": add_a_byte(f"{STATE}/identify/output.json"),
    "lock of the packages": add_a_byte(f"{STATE}/deploy/requirements.txt"),
    "runtime of the server": add_a_byte(f"{STATE}/serve/runtime/__init__.py"),
    "state file": add_a_byte(f"{STATE}/state.json"),
    "journal": new(".octoform/bench/journal.jsonl"),
    "new artifact": new(f"{STATE}/probe/more.json"),
    "new schema": new("protocol/schemas/more.json"),
    "new empty folder": lambda bench: (bench.project / STATE / "more").mkdir(),
    "new link": lambda bench: (bench.project / STATE / "serve" / "more").symlink_to("runtime"),
    "artifact removed": removed(f"{STATE}/probe/output.json"),
    "spec removed": removed("protocol/probe.md"),
    "manifest removed": removed("octopus.yaml"),
    "artifact behind a link": link_in_place(f"{STATE}/identify/output.json"),
    "spec behind a link": link_in_place("protocol/identify.md"),
    "hardware appeared": lambda bench: bench.hardware("usb:v0A0Ap0001d0100", "usb:v0B0Bp0002d0100"),
    "hardware gone": lambda bench: bench.hardware(),
    "launcher gone": lambda bench: (bench.layout.endpoint / "launch").unlink(),
    "endpoint did not answer": no_answer,
    "package upgraded": upgraded,
    "memo edited": edit_memo,
    "memo cut": cut_memo,
    "memo behind a link": link_memo,
    "memo gone": removed(".octoform/compiled.json"),
    "memo of another format": lambda bench: rewrite_seal(bench, format=0),
}


@pytest.mark.parametrize("change", MOVED.values(), ids=MOVED)
def test_is_not_believed_when_something_moved(bench: Bench, change: Callable[[Bench], None]) -> None:
    change(bench)
    assert not bench.hit()


def test_is_believed_after_everything_was_only_touched(bench: Bench) -> None:
    for folder in ("protocol", "profiles", "state", ".octoform"):
        for path in (bench.project / folder).rglob("*"):
            os.utime(path, (1, 1))
    os.utime(bench.project / "octopus.yaml", (1, 1))
    assert bench.hit()


def test_another_version_of_octoform_does_not_believe_it(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(octoform, "__version__", "99.0.0")
    assert not bench.hit()


def test_another_interpreter_does_not_believe_it(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "version", "9.9.9")
    assert not bench.hit()


def test_edited_code_of_octoform_does_not_believe_it(bench: Bench, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(cache.PACKAGE, copy)
    before = cache.build_of(copy)
    (copy / "plan" / "diff.py").write_text("# not the same\n")
    assert cache.build_of(copy) != before


def test_variables_that_the_manifest_reads_count_and_others_do_not(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("SOMETHING_ELSE", "new")
    assert bench.hit()
    monkeypatch.delenv("AGENT_TOKEN")
    assert not bench.hit()


def test_another_system_root_does_not_believe_it(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCTOFORM_SYSROOT")
    assert not bench.hit()


def test_no_value_of_a_variable_is_in_it(bench: Bench) -> None:
    assert b"AGENT_TOKEN" in bench.memo.read_bytes()
    assert of_bytes(b"one").encode() not in bench.memo.read_bytes()
    assert b'"one"' not in bench.memo.read_bytes()


def test_a_linked_source_is_followed_to_its_bytes(bench: Bench) -> None:
    link_in_place("profiles/lamp.md")(bench)
    assert bench.run("apply", "-auto-approve") == 0
    assert bench.hit()
    with (bench.project / "elsewhere").open("a") as file:
        file.write("It is green.\n")
    assert not bench.hit()


@pytest.mark.parametrize("change", [None, "manifest", "artifact", "hardware appeared", "memo cut", "launcher gone"])
def test_a_plan_writes_nothing_whatever_it_finds(bench: Bench, change: str | None) -> None:
    if change is not None:
        MOVED[change](bench)
    before = tree(bench.project)
    for arguments in (["plan"], ["plan", "-json"], ["plan", "-target", "identify"], ["plan", "-destroy"]):
        assert bench.run(*arguments) == 0
    assert tree(bench.project) == before


def test_says_the_same_as_the_long_way(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    assert bench.run("plan") == 0
    short = capsys.readouterr().out
    bench.memo.unlink()
    assert bench.run("plan") == 0
    assert capsys.readouterr().out == short


def test_an_apply_that_leaves_work_keeps_no_memo(bench: Bench) -> None:
    (bench.project / "protocol" / "deploy.md").write_bytes(
        (bench.project / "protocol" / "deploy.md").read_bytes() + b"\nOne more sentence.\n"
    )
    assert bench.run("apply", "-auto-approve", "-target", "identify") == 0
    assert not bench.memo.exists()


@pytest.mark.parametrize("command", ["plan", "status", "health", "tools", "audit"])
def test_with_a_memo_nothing_heavy_is_imported(bench: Bench, command: str) -> None:
    script = "import sys; from octoform.cli.main import main; main(sys.argv[1:]); print(sorted(sys.modules))"
    assert bench.hit()
    program = [sys.executable, "-c", script, "-chdir", str(bench.project), command]
    done = subprocess.run(program, capture_output=True, text=True, check=True, env=dict(os.environ))
    imported = {name.partition(".")[0] for name in json.loads(done.stdout.splitlines()[-1].replace("'", '"'))}
    assert imported.isdisjoint(HEAVY)


def test_with_a_memo_a_plan_leaves_what_the_parts_need_that_it_does_not_use(bench: Bench) -> None:
    """The library of dataclasses brings the inspector of sources with it, that of arguments the catalogues of words."""
    script = "import sys; from octoform.cli.main import main; main(sys.argv[1:]); print(*sys.modules)"
    assert bench.hit()
    program = [sys.executable, "-c", script, "-chdir", str(bench.project), "plan"]
    done = subprocess.run(program, capture_output=True, text=True, check=True, env=dict(os.environ))
    imported = set(done.stdout.splitlines()[-1].split())
    assert imported.isdisjoint({"dataclasses", "inspect", "ast", "argparse", "gettext", "socket", "shutil", "decimal"})
    assert imported.isdisjoint({"octoform.contracts", "octoform.plan.diff", "octoform.cli.parser"})


def test_the_memo_says_the_warnings_that_the_long_way_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A chosen profile that matches no device, and an answer about a device that is not there, last until edited."""
    project = tmp_path / "project"
    shutil.copytree(SHIPPED, project / "protocol")
    (project / "profiles").mkdir()
    (project / "profiles" / "rail.md").write_text(PROFILE.replace("lamp", "rail").replace("USB Serial", "No Such"))
    manifest = MANIFEST.replace("lamp.md", "rail.md") + "answers: {usb-ffff-0001: a lamp}\n"
    (project / "octopus.yaml").write_text(manifest)
    bench = Bench(project, tmp_path / "root")
    bench.hardware("usb:v0A0Ap0001d0100")
    monkeypatch.setenv("OCTOFORM_SYSROOT", str(bench.root))
    monkeypatch.setenv("AGENT_TOKEN", "one")
    Settled(project, os.environ).apply()
    assert bench.run("apply", "-auto-approve") == 0
    assert bench.hit()
    capsys.readouterr()
    aside = bench.memo.with_suffix(".aside")
    for command, where in ((["plan"], 1), (["plan", "-json"], 0)):
        lines = []
        for place in (bench.memo, aside):
            bench.memo.rename(place)
            bench.run(*command)
            lines.append([re.sub('"@timestamp": "[^"]*"', "", text) for text in capsys.readouterr()])
        aside.rename(bench.memo)
        assert lines[0] == lines[1]
        assert "PROFILE-UNMATCHED" in lines[0][where] and "PLAN-ANSWER-WITHOUT-DEVICE" in lines[0][where]
    bench.run("status", "-json")
    (warning,) = json.loads(capsys.readouterr().out)["warnings"]
    assert "rail" in warning["summary"]


def git(folder: Path, *arguments: str) -> None:
    identity = ("-c", "user.name=A Person", "-c", "user.email=person@example.org")
    subprocess.run(["git", *identity, "-C", str(folder), *arguments], check=True, capture_output=True)


def test_after_a_commit_it_tells_revision_and_dirty_files_as_the_long_way_does(
    bench: Bench, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    git(bench.project.parent, "init", "-q")
    git(bench.project.parent, "add", "project/octopus.yaml")
    git(bench.project.parent, "commit", "-q", "-m", "one")
    assert bench.run("apply", "-auto-approve") == 0
    git(bench.project.parent, "commit", "-q", "--allow-empty", "-m", "two")
    capsys.readouterr()
    assert bench.hit()
    assert bench.run("plan") == 0
    short = capsys.readouterr().out
    assert "uncommitted profiles/lamp.md" in short
    bench.memo.rename(bench.memo.with_suffix(".aside"))
    assert bench.run("plan") == 0
    assert capsys.readouterr().out == short
    bench.memo.with_suffix(".aside").rename(bench.memo)
    monkeypatch.setenv("PATH", "/nonexistent")
    assert not bench.hit()  # git cannot be asked, so a complete plan reports that
